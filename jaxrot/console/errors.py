"""The one exception of the commands: something their user can mend."""


class UserError(Exception):
    """What is wrong and what was expected, in one line."""
