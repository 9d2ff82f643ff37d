"""The folder of a command's results: tried before anything is computed, filled only when everything is there."""

import os
import shutil
import tempfile
from collections.abc import Mapping
from pathlib import Path

from jaxrot.console.errors import UserError, shown


def check_writable(folder: Path) -> None:
    """Refuses a folder that could not be written to at the end, and leaves no trace of the attempt.

    Permission bits do not tell (an administrator, a read-only file system), so it tries.

    Raises:
        UserError: The path is a file, leads through one, or cannot be written to.
    """
    try:
        if folder.exists() and not folder.is_dir():
            raise UserError(f"--out {shown(folder)}: this is a file; expected a folder, or a name for a new one")
        nearest = next(place for place in [folder, *folder.absolute().parents] if place.exists())
        if not nearest.is_dir():
            raise UserError(
                f"--out {shown(folder)}: {shown(nearest)} is a file; expected a folder, or a name for a new one"
            )
        # A file without a name where the system has such: nothing is left behind, whenever Ctrl-C is pressed.
        tempfile.TemporaryFile(prefix=".jaxrot-", dir=nearest).close()
    except OSError as error:
        raise _cannot_write(folder, error) from None


def write_files(folder: Path, files: Mapping[str, bytes]) -> None:
    """Writes all files or none.

    They are written to a temporary folder on the same file system first: what is left to fail in the end are renames.
    Other files in an existing folder stay.

    Raises:
        UserError: Something cannot be written.
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
    return UserError(
        f"--out {shown(folder)}: cannot be written to ({reason}); expected a folder, or a name for a new one"
    )
