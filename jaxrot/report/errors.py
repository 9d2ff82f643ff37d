"""The one exception of the report: something its user can mend."""


class ReportError(Exception):
    """What is wrong and what was expected, in one line."""
