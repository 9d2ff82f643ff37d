"""The parser of the command line, and the types of its arguments."""

import argparse
from pathlib import Path
from typing import Any, NoReturn

from jaxrot.console.errors import one_line
from jaxrot.console.printing import complain, show


class Parser(argparse.ArgumentParser):
    """A parser whose error messages are one line, without the usage."""

    def error(self, message: str) -> NoReturn:
        """Ends the process with status 2 and one line."""
        complain(f"{self.prog}: {one_line(message)}; see {self.prog} --help")
        self.exit(2)

    def print_help(self, file: Any = None) -> None:
        """Prints the help, or raises as `show` does."""
        if file is not None:
            super().print_help(file)
            return
        # argparse ignores an error of standard output.
        show(self.format_help().rstrip("\n"))


def path(word: str) -> Path:
    """Returns a file or a folder. An empty word, such as a shell variable that is not set, is refused."""
    if not word:
        # It would be the current folder.
        raise argparse.ArgumentTypeError("the name is empty; expected that of a file or a folder")
    return Path(word)
