"""How a command that cannot go on leaves: with an error that people can act on, and an exit code for programs."""

from __future__ import annotations

import errno
import json
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import typer
from rich.console import Console
from rich.markup import escape

from aug3d_core.photos.discover import trouble_with_photos
from aug3d_core.run.errors import Aug3dError, StageFailed, UsageError
from aug3d_core.run.full_disk import NO_ROOM_ERRORS, disk_failure, disk_full, no_room, target_full

_ALLOW = "let this user read or write it, or name another path"
_REMEDIES = {
    errno.EACCES: _ALLOW,
    errno.EPERM: _ALLOW,
    errno.EROFS: "name a path on a disk that can be written",
    errno.ENOENT: "check the path: nothing is there, or it has gone since",
    errno.EISDIR: "name a file: this is a folder",
    errno.ENOTDIR: "check the path: a part of it is a file, not a folder",
}


def check_photos(folder: Path) -> None:
    """Raise UsageError if the folder that --photos names has no photographs to give."""
    if trouble := trouble_with_photos(folder):
        raise UsageError(
            f"--photos {folder} {trouble}", "give the folder that holds the photographs, as JPEG, PNG or TIFF files"
        )


@contextmanager
def typed_errors(as_json: bool, home: Path = Path(), *, goes_on: bool = False) -> Iterator[None]:
    """Print an error that people can act on, and leave with the exit code that programs read.

    home: whose disk may be full. goes_on: what was stopped goes on where it was when it is asked for again.
    """
    try:
        yield
    except Aug3dError as error:
        raise _left(error, as_json) from error
    except (typer.Exit, typer.Abort, typer.BadParameter):
        raise
    except Exception as error:  # of any library that meets a full disk, or a server whose database is on it
        if disk_full(error) or no_room(home):
            raise _left(_disk_failure(home, error), as_json) from error
        if not (isinstance(error, OSError) and error.filename and error.errno in _REMEDIES):
            raise
        raise _left(_path_failure(error), as_json) from error
    except KeyboardInterrupt:
        print("stopped" + "; run the same command again to go on where it was" * goes_on, file=sys.stderr)
        raise typer.Exit(130) from None


def _disk_failure(home: Path, error: Exception) -> Aug3dError:
    """Return the typed error of the disk that is full: that of the file which the system names, else the home's."""
    named = error.filename if isinstance(error, OSError) and error.errno in NO_ROOM_ERRORS else None
    if isinstance(named, str) and not Path(named).absolute().is_relative_to(home.absolute()):
        return target_full(Path(named), _briefly(error))
    return disk_failure(home, _briefly(error))


def _path_failure(error: OSError) -> Aug3dError:
    """Return the typed error of a path that cannot be used."""
    return Aug3dError(f"{error.filename}: {error.strerror}", _REMEDIES[error.errno or 0])


def _briefly(error: Exception) -> str:
    """Return the first line of what a library says: those of servers go on with advice about HTTP."""
    return (str(error).strip() or type(error).__name__).partition("\n")[0]


def _left(error: Aug3dError, as_json: bool) -> typer.Exit:
    """Tell an error, and return how the command leaves."""
    if as_json:
        print(json.dumps({"state": "refused", "failure": {"problem": error.problem, "remedy": error.remedy}}))
    else:
        _print_error(error)
    return typer.Exit(2 if isinstance(error, UsageError) else 1)


def _print_error(error: Aug3dError) -> None:
    console = Console(stderr=True)
    if isinstance(error, StageFailed) and error.cause != "refused":  # a refusal says all there is to say
        console.print(f"[dim]{escape(error.log_tail)}[/]", highlight=False)
    console.print(f"[bold red]error[/] {escape(error.problem)}", highlight=False, soft_wrap=True)
    console.print(f"  -> {escape(error.remedy)}", highlight=False, soft_wrap=True)
    if isinstance(error, StageFailed) and error.replay:
        console.print(f"  replay: {escape(error.replay)}", highlight=False, soft_wrap=True)
