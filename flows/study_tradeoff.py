"""`aug3d study tradeoff`: what every setting of the factory costs, what it gains, and the cheapest way to enough."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from rich.console import Console
from rich.markup import escape
from rich.table import Table

from aug3d_core.scene_config import PRESETS
from aug3d_core.store import layout
from aug3d_core.store.store import Store
from flows.preflight import check_servers
from flows.refusal import typed_errors
from flows.settings import apply_local_environment
from flows.study import HOME, AsJson, Home, Seeds, Set, Watch

if TYPE_CHECKING:
    from aug3d_core.tradeoff.arm import Result
    from aug3d_core.tradeoff.point import Point
    from aug3d_core.tradeoff.study import Studied

_WIDTH = 140
WORST = ("auto_regret_db", "auto_time_ratio", "search_cost_ratio", "search_found_ratio", "search_regret_db")


def study_tradeoff(
    scenes: Annotated[
        list[str],
        typer.Argument(help="Scenes: demo for the built-in town, one of the registry, or with a finished run."),
    ],
    home: Home = HOME,
    preset: Annotated[
        str | None,
        typer.Option(
            help=f"What configurations differ from: {', '.join(PRESETS)}. Without it, the scene's own settings."
        ),
    ] = None,
    set_: Set = [],
    seeds: Seeds = 3,
    target_db: Annotated[
        float | None, typer.Option(help="PSNR (dB) that is enough. Without it: 0.3 dB below the best that is tried.")
    ] = None,
    search: Annotated[
        bool, typer.Option("--search", help="Do not try everything: only look for the cheapest that is enough.")
    ] = False,
    only: Annotated[
        list[str],
        typer.Option("--only", metavar="WORDS", help="Only panels with words that begin so, e.g. 'domes'; repeatable."),
    ] = [],
    quick: Annotated[
        bool, typer.Option("--quick", help="Few settings, one seed, few steps and a smaller town: minutes, for a look.")
    ] = False,
    as_json: AsJson = False,
) -> None:
    """Time against accuracy: every setting of every stage, the whole factory, and what `auto` makes of it (a night).

    Killed half way? Run it again: what was made is found again.
    """
    from aug3d_core.bench.machine import describe_machine
    from aug3d_core.tradeoff.findings import as_json as data
    from aug3d_core.tradeoff.findings import crashes
    from aug3d_core.tradeoff.scene import open_scene
    from aug3d_core.tradeoff.study import study_scene
    from aug3d_core.tradeoff.write import write_study

    with typed_errors(as_json):
        store, machine, told, crashed = Store(home), describe_machine(), [], 0
        with store.using():
            opened = [open_scene(store, name, preset).with_settings(set_) for name in dict.fromkeys(scenes)]
            for scene in opened:
                scene.config()  # a wrong setting is told before anything is made
            check_servers()
            apply_local_environment(store.root)
            console = Console(stderr=True)
            for scene in opened:
                with Watch(console, 1) as watch:
                    done = _counting(watch)
                    runs = 1 if quick else seeds
                    found = study_scene(store, scene, quick, runs, target_db, search, watch.say, done, only)
                folder = write_study(store, found, machine)
                crashed += crashes(found)
                from tasks.studies import log_tradeoff  # Prefect and MLflow read their settings when they are imported

                if why := log_tradeoff(store, found, folder):
                    console.print(f"[yellow]note[/] {escape(why)}", highlight=False, soft_wrap=True)
                told.append(data(found, machine) | {"folder": str(folder)})
                if not as_json:
                    print_findings(Console(), found, folder)
        if as_json:
            print(json.dumps(worst(told) | {"name": "tradeoff", "machine": machine, "scenes": told}, indent=1))
        raise typer.Exit(3 if crashed else 0)


def worst(told: list[dict[str, Any]]) -> dict[str, float | None]:
    """Return the worst of each ratio and regret over the scenes; None where a scene has none."""
    values = {name: [scene[name] for scene in told] for name in WORST}
    return {name: None if None in found else max(found) for name, found in values.items()}


def _counting(watch: Watch):
    def done(result: Result, cells: int, total: int) -> None:
        figure = "no figure" if result.accuracy is None else f"{result.arm.judge.name} {result.accuracy:.4g}"
        said = result.trial.failure or f"{figure} in {result.cpu_seconds:.0f} processor s"
        watch.count(result.name, said, cells, total)

    return done


def print_findings(console: Console, found: Studied, folder: Path) -> None:
    """Print the front, the configurations that matter, or the panels that were chosen; and where the study is."""
    from aug3d_core.tradeoff.findings import against_best, panels, search_against_grid
    from aug3d_core.tradeoff.page import in_words
    from aug3d_core.tradeoff.point import on_front

    if not console.is_terminal:
        console.width = max(console.width, _WIDTH)
    if found.factory:
        front = on_front(found.whole)
        auto = [point for point in found.whole if point.arm.mark == "auto" and point not in front]
        title = f"{found.scene.name}: what nothing beats in both, and auto"
        console.print(_table(title, [*front, *auto]))
        console.print(in_words(found), markup=False, highlight=False, soft_wrap=True)
        for name, value in {**against_best(found), **search_against_grid(found)}.items():
            console.print(f"{name} {'-' if value is None else f'{value:.2f}'}", highlight=False)
    else:
        for points in panels(found):
            console.print(_table(f"{found.scene.name}: {points[0].arm.panel}", points))
    console.print(f"page, chart and data: {folder}", highlight=False, soft_wrap=True)
    console.print(f"all studies on one page: {folder.parents[1] / layout.STORY}", highlight=False, soft_wrap=True)


def _table(title: str, points: Sequence[Point]) -> Table:
    shown = Table("configuration", title=title)
    for heading in ("processor s", points[0].arm.judge.name, "seeds"):
        shown.add_column(heading, justify="right")
    for point in points:
        figure = "-" if point.accuracy is None else f"{point.accuracy:.4g}"
        shown.add_row(point.arm.label, f"{point.cpu_seconds:,.0f}", figure, str(len(point.results)))
    return shown
