"""The exceptions of the commands, and how names of the user's are shown in them."""


class UserError(Exception):
    """Something that the user can fix: what is wrong and what was expected, always in one line."""

    def __init__(self, message: str) -> None:
        super().__init__(one_line(message))


class UnreadError(Exception):
    """The reader of standard output has gone, as in `python -m jaxrot report | head`."""


def shown(name: object) -> str:
    """A name for a message: as it is if it can be read in one line, quoted and with escapes if not."""
    word = str(name)
    return word if word and word.isprintable() else repr(word)


def one_line(text: str) -> str:
    """The text with an escape instead of every character that does not print, such as a newline."""
    return "".join(c if c.isprintable() else c.encode("unicode_escape").decode("ascii") for c in text)
