"""The folder of a command's results: checked before anything is computed, written when all results are there."""

import os
import shutil
import tempfile
from collections.abc import Mapping
from pathlib import Path

from jaxrot.console.errors import UserError, shown

_EXPECTED = "expected a folder, or a name for a new one"


def check_writable(folder: Path) -> None:
    """Raises a UserError if the path is a file, leads through one, or cannot be written to.

    It tries to write, because permission bits say nothing about a read-only file system.
    """
    try:
        nearest = next(place for place in [folder, *folder.absolute().parents] if place.exists())
        if not nearest.is_dir():
            name = "this" if nearest == folder else shown(nearest)
            raise UserError(f"--out {shown(folder)}: {name} is a file; {_EXPECTED}")
        # Most systems give this file no name, so that nothing is left behind after a Ctrl-C.
        tempfile.TemporaryFile(prefix=".jaxrot-", dir=nearest).close()
    except OSError as error:
        raise _cannot_write(folder, error) from None


def write_files(folder: Path, files: Mapping[str, bytes]) -> None:
    """Writes all files, or none and raises a UserError. Other files in an existing folder stay.

    The files go to a temporary folder on the same file system first, so that only renames can fail after that.
    """
    temporary = None
    try:
        folder.parent.mkdir(parents=True, exist_ok=True)
        temporary = Path(tempfile.mkdtemp(prefix=".jaxrot-", dir=folder.parent if not folder.exists() else folder))
        for name, content in files.items():
            (temporary / name).write_bytes(content)
        if folder.exists():
            for name in files:
                os.replace(temporary / name, folder / name)
        else:
            mask = os.umask(0)
            os.umask(mask)
            temporary.chmod(0o777 & ~mask)  # mkdtemp makes it private
            temporary.rename(folder)
    except OSError as error:
        raise _cannot_write(folder, error) from None
    finally:
        if temporary is not None:
            shutil.rmtree(temporary, ignore_errors=True)


def _cannot_write(folder: Path, error: OSError) -> UserError:
    reason = (error.strerror or str(error)).lower()
    return UserError(f"--out {shown(folder)}: cannot be written to ({reason}); {_EXPECTED}")
