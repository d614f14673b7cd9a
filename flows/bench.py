"""`aug3d bench`: the figures that the README quotes, measured again on this machine."""

from __future__ import annotations

import json
import os
import shutil
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from rich.console import Console
from rich.table import Table

from aug3d_core.run.atomic_file import write_synced
from aug3d_core.store import layout
from aug3d_core.store.layout import SHARED_VARIABLE
from aug3d_core.store.store import Store
from aug3d_core.store.timed import timed_folder
from flows.options import DEFAULT_HOME, AsJson, Home
from flows.refusal import typed_errors

if TYPE_CHECKING:
    from aug3d_core.bench.figure import Figure
    from aug3d_core.studies.common.trial import Measured, Say


bench = typer.Typer(no_args_is_help=True, help="Measure again, on this machine, the figures that are quoted.")


Preset = Annotated[str, typer.Option(help="Preset that is measured.")]
Set = Annotated[
    list[str],
    typer.Option("--set", metavar="STAGE.FIELD=VALUE", help="Measure with this setting changed, e.g. a smaller town."),
]


@dataclass(frozen=True)
class Measurement:
    """What a benchmark found, and what it was measured on."""

    figures: dict[str, Figure]
    about: dict[str, Any] = field(default_factory=dict)


@bench.command("geometry")
def bench_geometry(
    home: Home = DEFAULT_HOME,
    preset: Preset = "tiny",
    photos: Annotated[
        Path | None, typer.Option(help="Also choose pairs among these photographs, and among all of them.")
    ] = None,
    set_: Set = [],
    as_json: AsJson = False,
) -> None:
    """Poses, depth, points, mesh and map of the built-in town against its exact truth.

    Killed half way? Run it again: what was measured is kept until the benchmark is complete.
    """

    def measure(store: Store, scene: Measured, say: Say, console: Console) -> Measurement:
        from aug3d_core.bench import cloud, geometry, orthophoto

        figures = geometry.town_figures(store, scene, say) | orthophoto.figures(store, scene, say)
        figures |= cloud.figures(store, scene, say)
        figures |= geometry.pairs_speedup(store, scene, say, photos)
        figures |= geometry.pose_spread(store, scene, say)
        return Measurement(figures, {"pairs_measured_on": photos.name if photos else "town, its GPS not used"})

    _bench("geometry", home, preset, set_, as_json, measure)


@bench.command("views")
def bench_views(home: Home = DEFAULT_HOME, preset: Preset = "tiny", set_: Set = [], as_json: AsJson = False) -> None:
    """Grouping on every flight path, building boxes, choice of virtual cameras, rendering, and scale (about an hour).

    Killed half way? Run it again: what was measured is kept until the benchmark is complete.
    """

    def measure(store: Store, scene: Measured, say: Say, console: Console) -> Measurement:
        from aug3d_core.bench import buildings, city, coverage, grouping, rendering

        figures: dict[str, Figure] = {}
        for part in (city, coverage, rendering, buildings, grouping):
            found = part.figures(store, scene, say)
            _tell(found, console)
            figures |= found
        return Measurement(figures)

    _bench("views", home, preset, set_, as_json, measure)


@bench.command("heads")
def bench_heads(
    home: Home = DEFAULT_HOME,
    preset: Preset = "tiny",
    photos_root: Annotated[
        Path | None,
        typer.Option(
            help="Also train and judge on each folder of photographs in this one, and judge the town's model on them."
        ),
    ] = None,
    set_: Set = [],
    as_json: AsJson = False,
) -> None:
    """The plane sweep against cheap answers and PixelNeRF, and on places it never saw (an hour; the town alone: half of it).

    Killed half way? Run it again: stages that were made are kept until the benchmark is complete.
    """

    def measure(store: Store, scene: Measured, say: Say, console: Console) -> Measurement:
        from aug3d_core.bench import heads
        from aug3d_core.bench.scores import photo_sets

        photos = photo_sets(photos_root)
        return Measurement(heads.figures(store, scene, say, photos), {"photos": _names(photos)})

    _bench("heads", home, preset, set_, as_json, measure)


@bench.command("generalisation")
def bench_generalisation(
    home: Home = DEFAULT_HOME,
    preset: Preset = "tiny",
    photos_root: Annotated[
        Path | None, typer.Option(help="Judge on each folder of photographs in this one; figures have its first word.")
    ] = None,
    towns: Annotated[
        bool,
        typer.Option("--towns", help="Also train on 1, 3, 10 and 30 made-up towns, and judge each on the photographs."),
    ] = False,
    set_: Set = [],
    as_json: AsJson = False,
) -> None:
    """The shipped model on places that it never saw, tuned on them, and how fast many scenes are read (an hour).

    Killed half way? Run it again: stages that were made are kept until the benchmark is complete.
    """

    def measure(store: Store, scene: Measured, say: Say, console: Console) -> Measurement:
        from aug3d_core.bench import generalisation
        from aug3d_core.bench.scores import photo_sets

        photos = photo_sets(photos_root)
        return Measurement(generalisation.figures(store, scene, say, photos, towns), {"photos": _names(photos)})

    _bench("generalisation", home, preset, set_, as_json, measure)


@bench.command("machines")
def bench_machines(
    home: Home = DEFAULT_HOME,
    preset: Preset = "tiny",
    workers: Annotated[
        bool,
        typer.Option(
            "--workers",
            help="Also make small towns with one worker and two, kill them, and let their store go away (about 80 minutes).",
        ),
    ] = False,
    set_: Set = [],
    as_json: AsJson = False,
) -> None:
    """A store that several machines share beside a local folder: time, requests and bytes (twice the demo's time).

    At the service that AUG3D_STORE names; without it at moto's server, if that is installed. --workers: how much faster two
    workers are, what is made twice, how soon another takes over from one that was killed and what it makes again, how soon
    work goes on after the store was away. Nothing else should run on the machine then: each worker has one core.
    """

    def measure(store: Store, scene: Measured, say: Say, console: Console) -> Measurement:
        from aug3d_core.bench import machines
        from aug3d_core.bench.workers import PARTS

        where = os.environ.get(SHARED_VARIABLE, "").strip() or "moto's server"
        found = machines.figures(store, scene, say)
        figures = dict(found)
        for part in PARTS if workers else ():
            _tell(found, console)  # a part that fails ends the benchmark, after a long time
            found = part(store.root / "teams", say)
            figures |= found
        return Measurement(figures, {"measured_at": where})

    _bench("machines", home, preset, set_, as_json, measure)


@bench.command("scale")
def bench_scale(
    home: Home = DEFAULT_HOME,
    preset: Preset = "tiny",
    photos: Annotated[
        list[int], typer.Option(min=15, help="Size of a town [photographs]; name each size, the smallest first.")
    ] = [60, 120, 250],
    set_: Set = [],
    as_json: AsJson = False,
) -> None:
    """How time and memory of each stage grow with the number of photographs (40 minutes; 1,000 take 100 more).

    Killed half way? Run it again: stages that were made are kept until the benchmark is complete.
    """

    def measure(store: Store, scene: Measured, say: Say, console: Console) -> Measurement:
        from aug3d_core.bench import scale

        return Measurement(scale.figures(store, scene, say, photos))

    _bench("scale", home, preset, set_, as_json, measure)


@bench.command("spoiled")
def bench_spoiled(
    home: Home = DEFAULT_HOME,
    preset: Preset = "tiny",
    photos: Annotated[int, typer.Option(min=40, help="Of both days [photographs].")] = 120,
    set_: Set = [],
    as_json: AsJson = False,
) -> None:
    """Two days' flights about a lake with broken files and copies among them, beside the same without (ten minutes).

    Killed half way? Run it again: stages that were made are kept until the benchmark is complete.
    """

    def measure(store: Store, scene: Measured, say: Say, console: Console) -> Measurement:
        from aug3d_core.bench import spoiled_flights

        return Measurement(spoiled_flights.figures(store, scene, say, photos))

    _bench("spoiled", home, preset, set_, as_json, measure)


_PLAIN = {
    "nerf": "PixelNeRF: its speed against its plain version, and its quality on the town.",
    "growing": "What a tenth more photographs costs a finished town, beside it and spread over it (40 minutes).",
    "look": "A first look at photographs: seconds, heights against the truth, and what was spoiled on purpose (five minutes).",
    "advice": "What advice is worth: 20 photographs by it, in lines and at random, on three towns with a gap (an hour).",
    "view": "How many views a second `aug3d view` predicts, and how soon the first is there (the demo's time).",
    "gpu": "Training and views on a CUDA GPU, beside the same on this machine's cores (the demo's time, and five minutes).",
    "tiles": "The town's fusion and surface in 1, 4 and 16 tiles of ground: accuracy, borders, memory (twice the demo's time).",
}
_KEPT = "Killed half way? Run it again: what was made is kept until the benchmark is complete."


def _plain(name: str, told: str) -> None:
    """Make a command of a module of `aug3d_core.bench` that asks for nothing but what all ask for."""

    def measure(store: Store, scene: Measured, say: Say, console: Console) -> Measurement:
        return Measurement(import_module(f"aug3d_core.bench.{name}").figures(store, scene, say))

    @bench.command(name, help=f"{told}\n\n{_KEPT}")
    def measured(home: Home = DEFAULT_HOME, preset: Preset = "tiny", set_: Set = [], as_json: AsJson = False) -> None:
        _bench(name, home, preset, set_, as_json, measure)


for _name, _told in _PLAIN.items():
    _plain(_name, _told)


def _bench(
    name: str,
    home: Path,
    preset: str,
    overrides: list[str],
    as_json: bool,
    measure: Callable[[Store, Measured, Say, Console], Measurement],
) -> None:
    """Measure, keep figures and pictures in a folder of their own, print them, and exit."""
    from aug3d_core.bench.machine import describe_machine
    from aug3d_core.studies.common.trial import Measured

    with typed_errors(as_json, home, goes_on=True):
        console = Console(stderr=True)
        scene = Measured(preset, tuple(overrides))
        scene.config()  # a wrong setting is told before anything is measured
        # Two would share a folder that the first to end removes
        with Store(home).lock(layout.BENCH, name, timeout_s=0):
            unfinished = home / layout.BENCH / name
            with console.status("") as status:
                found = measure(Store(unfinished), scene, _saying(status, console), console)
            told = {
                "name": name,
                "machine": describe_machine(),
                "preset": preset,
                "settings": overrides,
                **found.about,
                "figures": {key: vars(figure) for key, figure in found.figures.items()},
            }
            kept = timed_folder(home / layout.BENCH, f"{name}-")
            write_synced(kept / layout.BENCH_FIGURES, json.dumps(told, indent=1).encode())
            if (pictures := unfinished / layout.BENCH_PICTURES).exists():
                pictures.rename(kept / layout.BENCH_PICTURES)
            shutil.rmtree(unfinished)
        _print(told, found.figures, kept, as_json)
        raise typer.Exit(0 if all(figure.value is not None for figure in found.figures.values()) else 1)


def _names(photos: Mapping[str, Path]) -> dict[str, str]:
    return {name: folder.name for name, folder in photos.items()}


def _saying(status: Any, console: Console) -> Say:
    """Return what shows progress on a terminal, and tells a log each stage as it begins."""
    begun = ""

    def say(stage: str, done: int, total: int, what: str) -> None:
        nonlocal begun
        status.update(f"{stage}: {done} of {total} {what}")
        if stage != begun and not console.is_terminal:
            console.print(f"{time.strftime('%H:%M:%S')} {stage} ...", highlight=False, markup=False)
        begun = stage

    return say


def _tell(figures: Mapping[str, Figure], console: Console) -> None:
    for name, figure in figures.items():
        console.print(f"{name}: {_value(figure)} {figure.unit}", style="dim", highlight=False)


def _value(figure: Figure) -> str:
    return figure.failure or "-" if figure.value is None else f"{figure.value:.4g}"


def _print(told: dict[str, Any], figures: dict[str, Figure], kept: Path, as_json: bool) -> None:
    if as_json:
        print(json.dumps(told, indent=1))
        return
    table = Table("figure", title=f"{told['name']} ({told['preset']}); {told['machine']}")
    for heading in ("measured", "goal"):
        table.add_column(heading, justify="right")
    for heading in ("unit", "holds"):
        table.add_column(heading)
    for name, figure in figures.items():
        goal = "" if figure.goal is None else f"{figure.goal:g}"
        table.add_row(name, _value(figure), goal, figure.unit, {True: "yes", False: "NO", None: ""}[figure.holds])
    console = Console()
    console.print(table)
    console.print(f"kept in {kept}", highlight=False, soft_wrap=True, markup=False)
