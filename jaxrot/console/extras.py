"""The check for packages that only a command needs."""

import importlib.util
from collections.abc import Sequence

from jaxrot.console.errors import UserError
from jaxrot.console.printing import is_watched


def check_installed(needed: Sequence[str], extra: str) -> None:
    """Checks for the packages that an extra of jaxrot brings, and for tqdm if standard error is a terminal.

    Raises:
        UserError: A package is not installed.
    """
    needed = [*needed, *(["tqdm"] if is_watched() else [])]
    missing = [name for name in needed if importlib.util.find_spec(name) is None]
    if missing:
        raise UserError(f"not installed: {', '.join(missing)}; expected: pip install 'jaxrot[{extra}]'")
