"""How a command that cannot go on leaves: with an error that people can act on, and an exit code for programs."""

from __future__ import annotations

import json
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import typer
from rich.console import Console
from rich.markup import escape

from aug3d_core.run.errors import Aug3dError, StageFailed, UsageError
from aug3d_core.run.full_disk import NO_ROOM_BYTES, disk_failure, disk_full, free_bytes


@contextmanager
def typed_errors(as_json: bool, home: Path = Path()) -> Iterator[None]:
    """Print an error that people can act on, and leave with the exit code that programs read.

    home: whose disk may be full.
    """
    try:
        yield
    except Aug3dError as error:
        raise _left(error, as_json) from error
    except (typer.Exit, typer.Abort, typer.BadParameter):
        raise
    except Exception as error:  # of any library that meets a full disk, or a server whose database is on it
        if not disk_full(error) and free_bytes(home) > NO_ROOM_BYTES:
            raise
        raise _left(disk_failure(home, _briefly(error)), as_json) from error
    except KeyboardInterrupt:
        print("stopped; run the same command again to go on where it was", file=sys.stderr)
        raise typer.Exit(130) from None


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
