"""`aug3d study`: the paper's tables on your scene, each arm several times, with intervals."""

from __future__ import annotations

import json
import time
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.console import Console
from rich.markup import escape
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn
from rich.table import Table

from aug3d_core.scene_config import PRESETS
from aug3d_core.store import layout
from aug3d_core.store.store import Store
from flows.preflight import check_servers
from flows.refusal import typed_errors
from flows.settings import apply_local_environment

if TYPE_CHECKING:
    from aug3d_core.study.arm import Study
    from aug3d_core.study.cell import Result
    from aug3d_core.study.findings import Findings

HOME = Path("aug3d_data")
_WIDTH = 140

study = typer.Typer(
    no_args_is_help=True, help="Make and judge a scene in many ways: what is better, dearer, or breaks."
)

Scene = Annotated[str, typer.Argument(help="Name of a scene with a finished run, such as demo.")]
Home = Annotated[Path, typer.Option(envvar="AUG3D_HOME", help="Folder for everything that aug3d makes.")]
Preset = Annotated[
    str | None, typer.Option(help=f"Settings from sampling on: {', '.join(PRESETS)}. Without it, the scene's own.")
]
Set = Annotated[
    list[str],
    typer.Option(
        "--set", metavar="STAGE.FIELD=VALUE", help="Change one setting of every arm, e.g. training.steps=500."
    ),
]
Seeds = Annotated[int, typer.Option(min=1, max=100, help="Runs of every arm, each with a seed of its own.")]
Quick = Annotated[bool, typer.Option("--quick", help="A few arms, two seeds and few steps: minutes, for a look.")]
AsJson = Annotated[bool, typer.Option("--json", help="Print JSON for programs; progress goes to stderr.")]


@study.command("grouping")
def study_grouping(
    scene: Scene,
    home: Home = HOME,
    preset: Preset = None,
    set_: Set = [],
    seeds: Seeds = 3,
    quick: Quick = False,
    as_json: AsJson = False,
) -> None:
    """Ways of grouping x K 20, 10, auto; then 3, 6, 9 input views for the best. The paper's first table.

    Killed half way? Run it again: what was made is found again.
    """
    from aug3d_core.study.grouping import grouping_study

    _study(grouping_study, scene, home, preset, set_, seeds, quick, as_json)


@study.command("augmentation")
def study_augmentation(
    scene: Scene,
    home: Home = HOME,
    preset: Preset = None,
    set_: Set = [],
    seeds: Seeds = 3,
    quick: Quick = False,
    as_json: AsJson = False,
) -> None:
    """Real photographs, virtual views, and both x K 20, 10, auto; and how many virtual views. The paper's second table.

    Killed half way? Run it again: what was made is found again.
    """
    from aug3d_core.study.augmentation import augmentation_study

    _study(augmentation_study, scene, home, preset, set_, seeds, quick, as_json)


def _study(
    arms: Callable[[bool], Study],
    scene: str,
    home: Path,
    preset: str | None,
    overrides: list[str],
    seeds: int,
    quick: bool,
    as_json: bool,
) -> None:
    from aug3d_core.bench.machine import describe_machine
    from aug3d_core.study.effort import repeats, study_effort
    from aug3d_core.study.findings import as_json as data
    from aug3d_core.study.findings import findings
    from aug3d_core.study.run import run_study
    from aug3d_core.study.scene import open_scene
    from aug3d_core.study.write import write_study

    with typed_errors(as_json):
        store = Store(home)
        with store.using():
            opened = study_effort(open_scene(store, scene, preset), quick, overrides)
            check_servers()
            apply_local_environment(store.root)
            chosen, runs = arms(quick), repeats(seeds, quick)
            console = Console(stderr=True)
            with Watch(console, len(chosen.arms) * runs * opened.folds) as watch:
                results = run_study(store, chosen, opened, runs, watch.say, watch.done)
            found = findings(chosen, opened, runs, results, describe_machine())
            folder = write_study(store, found)
            from tasks.studies import log_study  # Prefect and MLflow read their settings when they are imported

            if why := log_study(store, found, folder):
                console.print(f"[yellow]note[/] {escape(why)}", highlight=False, soft_wrap=True)
            if as_json:
                print(json.dumps(data(found) | {"folder": str(folder)}, indent=1))
            else:
                print_findings(Console(), found, folder)
        raise typer.Exit(3 if found.failed else 0)


class Watch:
    """Which cell is under way, and how many are left: a bar on a terminal, a line per cell elsewhere."""

    def __init__(self, console: Console, cells: int) -> None:
        """Prepare a bar of so many cells."""
        self._console = console
        self._bar = Progress(
            TextColumn("run {task.completed:.0f} of {task.total:.0f}"),
            BarColumn(bar_width=24),
            TimeElapsedColumn(),
            TextColumn("left"),
            TimeRemainingColumn(elapsed_when_finished=True),
            TextColumn("{task.fields[what]}", markup=False),
            console=console,
            disable=not console.is_terminal,
        )
        self._row = self._bar.add_task("", total=cells, what="")

    def __enter__(self) -> Watch:
        """Begin to draw."""
        self._bar.start()
        return self

    def __exit__(self, *_: object) -> None:
        """Leave the last state on the screen."""
        self._bar.stop()

    def say(self, stage: str, done: int, total: int, what: str) -> None:
        """Tell how far a step of the cell is."""
        self._bar.update(self._row, what=f"{stage}: {done} of {total} {what}")

    def done(self, result: Result, cells: int, total: int) -> None:
        """Count a cell of one of the paper's tables."""
        told = result.failure or f"{result.views['psnr'].mean():.2f} dB in {result.seconds:.0f} s"
        self.count(result.cell.name, told, cells, total)

    def count(self, name: str, told: str, cells: int, total: int) -> None:
        """Count a cell, and print what came out."""
        self._bar.update(self._row, completed=cells, total=total, what="")
        self._console.print(
            f"{time.strftime('%H:%M:%S')} [{cells}/{total}] {name}: {told}",
            markup=False,
            highlight=False,
            soft_wrap=True,
        )


def print_findings(console: Console, found: Findings, folder: Path) -> None:
    """Print what holds, the table, what is doubtful, and where the study is."""
    from aug3d_core.study.page import FIGURES, difference_text, figures

    if not console.is_terminal:
        console.width = max(console.width, _WIDTH)
    for part in dict.fromkeys(row.arm.part for row in found.rows):
        chosen = [row for row in found.rows if row.arm.part == part]
        table = Table("arm", title=f"{part}; PSNR in dB")
        for heading in FIGURES:
            table.add_column(heading, justify="right")
        for row in chosen:
            table.add_row(row.name, *figures(row))
        console.print(table)
    verdicts = Table("statement", "on this scene", "difference", title=found.study.question)
    for tested in found.tested:
        told = "\n".join(f"{difference_text(d)} over {d.second}" for d in tested.differences)
        verdicts.add_row(tested.ordering.claim, tested.verdict, told)
    console.print(verdicts)
    for row in found.rows:
        for note in row.notes:
            console.print(f"note {row.name}: {note}", markup=False, highlight=False)
    console.print(f"page, chart and data: {folder}", highlight=False, soft_wrap=True)
    console.print(f"all studies on one page: {folder.parents[1] / layout.STORY}", highlight=False, soft_wrap=True)
