"""`aug3d frames`: photographs out of a drone's films."""

from __future__ import annotations

import json
from pathlib import Path
from shlex import quote
from typing import TYPE_CHECKING, Annotated

import typer
from rich.console import Console
from rich.markup import escape
from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn

from flows.options import DEFAULT_HOME, AsJson
from flows.refusal import typed_errors

if TYPE_CHECKING:
    from aug3d_core.video.taken import Taken


def frames(
    films: Annotated[
        list[Path], typer.Argument(metavar="FILM...", help="Films of one place; several are taken together.")
    ],
    out: Annotated[Path, typer.Option(metavar="DIR", help="New or empty folder for the photographs.")],
    overlap: Annotated[
        float, typer.Option(min=0.5, max=0.95, help="Share of a frame that the next one shows too.")
    ] = 0.8,
    as_json: AsJson = False,
) -> None:
    """Take photographs out of films: frames that overlap as asked, the sharpest of neighbours, with time and place.

    Places come from the subtitles (SRT) that DJI's drones write beside a film. Then look at them: aug3d look DIR.
    """
    with typed_errors(as_json, DEFAULT_HOME):
        from aug3d_core.video.taken import take_frames  # with the decoder, which other commands do without

        with Progress(
            TextColumn("{task.description}"), BarColumn(), TimeRemainingColumn(),
            console=Console(stderr=True), transient=True,
        ) as bars:  # fmt: skip
            bar = bars.add_task("", total=None)
            told = take_frames(
                films, out, overlap,
                lambda film, second, of: bars.update(bar, description=escape(film.name), completed=second, total=of),
            )  # fmt: skip
        if as_json:
            print(json.dumps({"folder": str(out), "films": [_told(one) for one in told]}, indent=1))
            return
        console = Console()
        for one in told:
            placed = "with places" if one.placed else "without places: there are no subtitles with any beside it"
            console.print(
                f"{one.film.name}: {one.kept} photographs of {one.seconds:.0f} s, {placed}",
                highlight=False, soft_wrap=True, markup=False,
            )  # fmt: skip
        folder = quote(str(out))
        print(f"\nnext  aug3d look {folder}\n      aug3d run my_scene --photos {folder}")


def _told(one: Taken) -> dict:
    return {
        "film": str(one.film),
        "seconds": one.seconds,
        "photographs": one.kept,
        "with_places": one.placed,
        "overlaps": list(one.overlaps),
    }
