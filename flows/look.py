"""`aug3d look`: what can be said of photographs seconds after the flight, before any processing."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from rich.console import Console
from rich.markup import escape
from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn

from aug3d_core.run.atomic_file import write_synced
from aug3d_core.run.errors import UsageError
from aug3d_core.store.store import Store
from flows.options import DEFAULT_HOME, AsJson
from flows.refusal import typed_errors
from flows.settings import HOME_VARIABLE
from flows.words import time_words

if TYPE_CHECKING:
    from aug3d_core.factory.estimate.cost import Cost
    from aug3d_core.look.findings import Finding
    from aug3d_core.look.survey import Survey

_COLOURS = {"stop": "red", "warn": "yellow", "note": "dim"}
_NAMED = 5  # photographs of a finding that the terminal names


def look(
    photos: Annotated[Path, typer.Argument(metavar="DIR", help="Folder of photographs (JPEG, PNG, TIFF).")],
    out: Annotated[
        Path | None, typer.Option(metavar="FILE.html", help="The page to write. Default: look_DIR.html, here.")
    ] = None,
    home: Annotated[
        Path, typer.Option(envvar=HOME_VARIABLE, help="What was made there tells how fast this machine is.")
    ] = DEFAULT_HOME,
    as_json: AsJson = False,
) -> None:
    """Look at photographs before any processing: overlap, gaps, blur, exposure, positions, cameras, duplicates, and cost.

    Takes a tenth of a second a photograph, writes one HTML file and changes nothing. Exit code 3: they will not do as they are.
    """
    with typed_errors(as_json, home):
        photos = photos.absolute()
        out = out or Path(f"look_{photos.name or 'photos'}.html")
        if out.suffix.lower() not in (".html", ".htm") or not out.absolute().parent.is_dir():
            raise UsageError(f"--out {out} is no HTML file in a folder that exists", "name one like look.html")
        # With the libraries that open pictures, which other commands do without
        from aug3d_core.factory.estimate.calibration import calibration_by, calibration_of
        from aug3d_core.look.cost import costs_of
        from aug3d_core.look.findings import findings_of, verdict_of
        from aug3d_core.look.page import look_page
        from aug3d_core.look.survey import survey_of

        console = Console(stderr=True)
        with Progress(
            TextColumn("{task.description}"), BarColumn(), TextColumn("{task.completed}/{task.total}"),
            TimeRemainingColumn(), console=console, transient=True,
        ) as bars:  # fmt: skip
            bar = bars.add_task("photographs", total=None)
            survey = survey_of(photos, lambda done, total, _: bars.update(bar, completed=done, total=total))
            findings = findings_of(survey)
        enough = not any(one.weight == "stop" for one in findings)
        calibration = calibration_of(Store(home)) if home.is_dir() else calibration_by([])
        costs = costs_of(survey, calibration) if enough else {}
        write_synced(out.absolute(), look_page(survey, findings, costs).encode())
        if as_json:
            print(json.dumps(_told(survey, findings, costs, out), indent=1))
        else:
            _print(Console(), verdict_of(findings), findings, costs, out)
        raise typer.Exit(0 if enough else 3)


def _told(survey: Survey, findings: list[Finding], costs: Mapping[str, Cost], out: Path) -> dict[str, Any]:
    return {
        "photographs": len(survey.photos),
        "findings": [asdict(one) for one in findings],
        "cost": {
            preset: {"seconds": cost.seconds.likely, "peak_mib": cost.peak_mib.likely} for preset, cost in costs.items()
        },
        "page": str(out.absolute()),
    }


def _print(console: Console, verdict: str, findings: list[Finding], costs: Mapping[str, Cost], out: Path) -> None:
    console.print(f"[bold]{escape(verdict)}[/]", highlight=False)
    for one in findings:
        some = ", ".join(one.names[:_NAMED]) + (
            f" and {len(one.names) - _NAMED} more" if len(one.names) > _NAMED else ""
        )
        console.print(f"[{_COLOURS[one.weight]}]{one.weight}[/] {escape(one.what)}", highlight=False, soft_wrap=True)
        console.print(
            f"     {escape(one.to_do)}{escape(f' ({some})' if some else '')}",
            style="dim",
            highlight=False,
            soft_wrap=True,
        )
    for preset, cost in costs.items():
        console.print(f"a run with preset {preset}: about {time_words(cost.seconds.likely)}", highlight=False)
    console.print(f"page: {out}", highlight=False, soft_wrap=True, markup=False)
