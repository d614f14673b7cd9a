"""`aug3d study tradeoff`: what every setting of the factory costs and gains, and the cheapest that is enough."""

from __future__ import annotations

import json
from collections.abc import Sequence
from typing import TYPE_CHECKING, Annotated, Any

import typer
from rich.console import Console
from rich.table import Table

from aug3d_core.factory.config import PRESETS
from flows.options import DEFAULT_HOME, AsJson, Home
from flows.refusal import typed_errors
from flows.study import Seeds, Set, carry_out, print_folder, publish, using
from flows.words import widened

if TYPE_CHECKING:
    from aug3d_core.studies.tradeoff.arm import TradeoffResult
    from aug3d_core.studies.tradeoff.point import Point
    from aug3d_core.studies.tradeoff.study import TradeoffFindings

WORST = ("auto_regret_db", "auto_time_ratio", "search_cost_ratio", "search_found_ratio", "search_regret_db")


def study_tradeoff(
    scenes: Annotated[
        list[str],
        typer.Argument(help="Scenes: demo for the built-in town, one of the registry, or with a finished run."),
    ],
    home: Home = DEFAULT_HOME,
    preset: Annotated[
        str | None,
        typer.Option(
            help=f"What configurations differ from: {', '.join(PRESETS)}. Without it, the scene's own settings."
        ),
    ] = None,
    set_: Set = [],
    seeds: Seeds = 3,
    target_db: Annotated[
        float | None, typer.Option(help="PSNR that is enough [dB]. Without it: 0.3 dB below the best that is tried.")
    ] = None,
    search: Annotated[
        bool,
        typer.Option(
            "--search", help="Only search for the cheapest configuration that is enough; do not try everything."
        ),
    ] = False,
    only: Annotated[
        list[str],
        typer.Option(
            "--only", metavar="WORDS", help="Only panels with words that begin with these, e.g. 'domes'; repeatable."
        ),
    ] = [],
    quick: Annotated[
        bool, typer.Option("--quick", help="Few settings, one seed, few steps and a smaller town: takes minutes.")
    ] = False,
    as_json: AsJson = False,
) -> None:
    """Time against accuracy: every setting of every stage, the whole factory, and `auto` (a night).

    Killed half way? Run it again: outputs in the store are reused.
    """

    from aug3d_core.bench.machine import describe_machine
    from aug3d_core.studies.named import Asked
    from aug3d_core.studies.tradeoff.findings import crashes
    from aug3d_core.studies.tradeoff.page import publication

    with typed_errors(as_json, home, goes_on=True):
        machine, data, crashed, console = describe_machine(), [], 0, Console(stderr=True)
        given = {
            "seeds": seeds, "target_db": target_db, "search": search, "only": only, "quick": quick,
            "preset": preset, "overrides": set_,
        }  # fmt: skip
        with using(home) as store:
            studies = [Asked(name="tradeoff", given={"scene": scene, **given}) for scene in dict.fromkeys(scenes)]
            # A wrong setting is reported before anything is made
            for asked, prepared in [(asked, asked.prepared(store)) for asked in studies]:
                title = f"speed against accuracy of {asked.given['scene']}"
                found = carry_out(store, title, asked, prepared, console, _outcome)
                published = publication(found, machine)
                folder = publish(store, console, published)
                crashed += crashes(found)
                data.append({**published.data, "folder": str(folder)})
                if not as_json:
                    print_findings(Console(), found)
                    print_folder(folder)
        if as_json:
            print(json.dumps(worst(data) | {"name": "tradeoff", "machine": machine, "scenes": data}, indent=1))
        raise typer.Exit(3 if crashed else 0)


def worst(scenes: list[dict[str, Any]]) -> dict[str, float | None]:
    """Return the worst of each ratio and regret over the scenes; None where a scene has none."""
    values = {name: [scene[name] for scene in scenes] for name in WORST}
    return {name: None if None in found else max(found) for name, found in values.items()}


def _outcome(result: TradeoffResult) -> str:
    figure = "no figure" if result.accuracy is None else f"{result.arm.judge.name} {result.accuracy:.4g}"
    return result.failure or f"{figure} in {result.cpu_seconds:.0f} processor s"


def print_findings(console: Console, found: TradeoffFindings) -> None:
    """Print the front and `auto`, or the chosen panels."""
    from aug3d_core.studies.tradeoff.findings import against_best, panels, search_against_grid
    from aug3d_core.studies.tradeoff.page import in_words
    from aug3d_core.studies.tradeoff.point import on_front

    console = widened(console)
    if found.factory:
        front = on_front(found.whole)
        auto = [point for point in found.whole if point.arm.mark == "auto" and point not in front]
        title = f"{found.scene.name}: best in speed or accuracy, and auto"
        console.print(_table(title, [*front, *auto]))
        console.print(in_words(found), markup=False, highlight=False, soft_wrap=True)
        for name, value in {**against_best(found), **search_against_grid(found)}.items():
            console.print(f"{name} {'-' if value is None else f'{value:.2f}'}", highlight=False)
    else:
        for points in panels(found):
            console.print(_table(f"{found.scene.name}: {points[0].arm.panel}", points))


def _table(title: str, points: Sequence[Point]) -> Table:
    shown = Table("configuration", title=title)
    for heading in ("processor s", points[0].arm.judge.name, "seeds"):
        shown.add_column(heading, justify="right")
    for point in points:
        figure = "-" if point.accuracy is None else f"{point.accuracy:.4g}"
        shown.add_row(point.arm.label, f"{point.cpu_seconds:,.0f}", figure, str(len(point.results)))
    return shown
