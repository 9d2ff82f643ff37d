"""The exceptions of the commands, and names in their messages."""


class UserError(Exception):
    """A mistake that the user can fix: what is wrong and what was expected, in one line."""

    def __init__(self, message: str) -> None:
        super().__init__(one_line(message))


class UnreadError(Exception):
    """The reader of standard output has gone, as in `python -m jaxrot report | head`."""


def shown(name: object) -> str:
    """A name for a message, quoted and with escapes if it is empty or does not print in one line."""
    word = str(name)
    return word if word and word.isprintable() else repr(word)


def one_line(text: str) -> str:
    """The text with an escape instead of every character that does not print, such as a newline."""
    return "".join(c if c.isprintable() else c.encode("unicode_escape").decode("ascii") for c in text)
