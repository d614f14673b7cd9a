"""The folder that an export is written to."""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from aug3d_core.run.errors import Aug3dError, UsageError
from aug3d_core.run.full_disk import disk_full, no_room, target_full


def check_empty(folder: Path) -> None:
    """Raise UsageError unless the folder is new or empty."""
    if folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
        raise UsageError(f"{folder} is not an empty folder", "name a new or empty folder")


@contextmanager
def filling(folder: Path) -> Iterator[None]:
    """Let a folder be filled that is new or empty; a failure leaves it as it was, so that the same command may run again.

    Raises UsageError unless it is new or empty; DiskFull for any error of a library that came of its full disk.
    """
    check_empty(folder)
    new = not folder.exists()
    try:
        yield
    except BaseException as error:
        said = str(error) or type(error).__name__
        full = target_full(folder, said) if _is_full(folder, error) else None  # looked at before room is made
        _emptied(folder, new)
        if full:
            raise full from error
        raise


def _is_full(folder: Path, error: BaseException) -> bool:
    """Say whether a full disk is what an error came of: of the libraries that write, many keep no word of the system's."""
    if not isinstance(error, Exception) or isinstance(error, Aug3dError):
        return False
    return disk_full(error) or no_room(folder)


def _emptied(folder: Path, new: bool) -> None:
    if new:
        shutil.rmtree(folder, ignore_errors=True)
        return
    for one in folder.iterdir():
        if one.is_dir() and not one.is_symlink():
            shutil.rmtree(one, ignore_errors=True)
        else:
            one.unlink(missing_ok=True)
