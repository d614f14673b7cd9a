"""`aug3d bench`: the figures that the README quotes, measured again on this machine."""

from __future__ import annotations

import json
import shutil
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from rich.console import Console
from rich.table import Table

from aug3d_core.store import layout
from aug3d_core.store.store import Store, write_synced
from flows.refusal import typed_errors

if TYPE_CHECKING:
    from aug3d_core.bench.figure import Figure
    from aug3d_core.bench.front import Point
    from aug3d_core.bench.trial import Say

bench = typer.Typer(no_args_is_help=True, help="Measure again, on this machine, the figures that are quoted.")


@bench.command("geometry")
def bench_geometry(
    home: Annotated[Path, typer.Option(envvar="AUG3D_HOME", help="Folder for everything that aug3d makes.")] = Path(
        "aug3d_data"
    ),
    preset: Annotated[str, typer.Option(help="Preset that is measured.")] = "tiny",
    photos: Annotated[
        Path | None, typer.Option(help="Also choose pairs among these photographs, and among all of them.")
    ] = None,
    sweep: Annotated[
        bool, typer.Option("--sweep", help="Also chart time against accuracy, setting by setting (about an hour).")
    ] = False,
    set_: Annotated[
        list[str],
        typer.Option(
            "--set", metavar="STAGE.FIELD=VALUE", help="Measure with this setting changed, e.g. a smaller town."
        ),
    ] = [],
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON for programs; progress goes to stderr.")] = False,
) -> None:
    """Poses, depth and mesh of the built-in town against its exact truth.

    Killed half way? Run it again: what was measured is kept until the benchmark is complete.
    """
    from aug3d_core.bench import front, geometry  # charts are slow to import, and no other command needs them
    from aug3d_core.bench.machine import describe_machine
    from aug3d_core.bench.trial import Measured

    with typed_errors(as_json):
        console = Console(stderr=True)
        scene = Measured(preset, tuple(set_))
        scene.config()  # a wrong setting is told before anything is measured
        unfinished = home / layout.BENCH / "geometry"
        store = Store(unfinished)
        with console.status("") as status:
            say = _saying(status)
            figures = geometry.town_figures(store, scene, say)
            figures |= geometry.pairs_speedup(store, scene, say, photos)
            figures |= geometry.pose_spread(store, scene, say) | geometry.growth(store, scene, say)
            points = []
            if sweep:
                for point in geometry.sweep(store, scene, say):
                    points.append(point)
                    console.print(_told(point), style="dim", highlight=False)
        told = {
            "name": "geometry",
            "machine": describe_machine(),
            "preset": preset,
            "settings": list(set_),
            "pairs_measured_on": photos.name if photos else "town, its GPS not used",
            "figures": {name: vars(figure) for name, figure in figures.items()},
        }
        kept = home / layout.BENCH / f"geometry-{datetime.now(UTC):%Y-%m-%dT%H-%M-%S}"
        kept.mkdir(parents=True)
        write_synced(kept / layout.BENCH_FIGURES, json.dumps(told, indent=1).encode())
        if points:
            front.table(points).to_parquet(kept / layout.BENCH_POINTS)
            front.draw(
                points,
                geometry.LOWER_IS_BETTER,
                " ".join(["town, preset", preset, *set_, "\n", told["machine"]]),
                kept / layout.BENCH_CHART,
            )
        shutil.rmtree(unfinished)
        _print(told, figures, kept, as_json)
        raise typer.Exit(0 if all(figure.value is not None for figure in figures.values()) else 1)


def _saying(status: Any) -> Say:
    def say(stage: str, done: int, total: int, what: str) -> None:
        status.update(f"{stage}: {done} of {total} {what}")

    return say


def _told(point: Point) -> str:
    result = point.failure if point.accuracy is None else f"{point.accuracy_name} {point.accuracy:.4g}"
    return f"{point.setting} {point.value}: {point.seconds:.1f} s, {point.peak_mib:.0f} MiB, {result}"


def _print(told: dict[str, Any], figures: dict[str, Figure], kept: Path, as_json: bool) -> None:
    if as_json:
        print(json.dumps(told, indent=1))
        return
    table = Table("figure", title=f"geometry ({told['preset']}); {told['machine']}")
    for heading in ("measured", "goal"):
        table.add_column(heading, justify="right")
    for heading in ("unit", "holds"):
        table.add_column(heading)
    for name, figure in figures.items():
        value = figure.failure or "-" if figure.value is None else f"{figure.value:.4g}"
        goal = "" if figure.goal is None else f"{figure.goal:g}"
        table.add_row(name, value, goal, figure.unit, {True: "yes", False: "NO", None: ""}[figure.holds])
    console = Console()
    console.print(table)
    console.print(f"kept in {kept}", highlight=False, soft_wrap=True)
