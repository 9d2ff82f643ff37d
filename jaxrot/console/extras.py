"""Packages that only a command needs: asked for before anything is computed."""

import importlib.util
from collections.abc import Sequence

from jaxrot.console.errors import UserError
from jaxrot.console.printing import is_watched


def check_installed(needed: Sequence[str], extra: str) -> None:
    """Refuses to begin without the packages; tqdm, the progress bar, is needed where somebody is looking.

    Args:
        needed: Names of packages.
        extra: The extra of jaxrot that brings them.

    Raises:
        UserError: One is not installed.
    """
    needed = [*needed, *(["tqdm"] if is_watched() else [])]
    missing = [name for name in needed if importlib.util.find_spec(name) is None]
    if missing:
        verb = "is" if len(missing) == 1 else "are"
        raise UserError(f"{' and '.join(missing)} {verb} not installed; expected: pip install 'jaxrot[{extra}]'")
