"""`aug3d study`: what all studies of the command line share; and the paper's tables, each arm several times, with intervals."""

from __future__ import annotations

import json
import os
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, TypeVar

import typer
from rich.console import Console
from rich.markup import escape
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn
from rich.table import Table

from aug3d_core.factory.config import PRESETS
from aug3d_core.factory.scheduler import scheduler_from
from aug3d_core.run.limits import limits_from
from aug3d_core.store import layout
from aug3d_core.store.store import Store
from flows.options import DEFAULT_HOME, AsJson, Home
from flows.preflight import check_servers
from flows.refusal import typed_errors
from flows.server import prefect_server
from flows.settings import apply_local_environment
from flows.words import widened

if TYPE_CHECKING:
    from aug3d_core.factory.walk import Visit
    from aug3d_core.studies.common.cell import Result
    from aug3d_core.studies.common.publication import Publication
    from aug3d_core.studies.named import Asked, Prepared
    from aug3d_core.studies.paper.cell import PaperResult
    from aug3d_core.studies.paper.findings import PaperFindings

FoundT = TypeVar("FoundT")

study = typer.Typer(
    no_args_is_help=True, help="Make and judge a scene in many ways: what is better, dearer, or breaks."
)

Scene = Annotated[str, typer.Argument(help="Name of a scene with a finished run, such as demo.")]
Preset = Annotated[
    str | None, typer.Option(help=f"Settings from sampling on: {', '.join(PRESETS)}. Without it, the scene's own.")
]
Set = Annotated[
    list[str],
    typer.Option(
        "--set", metavar="STAGE.FIELD=VALUE", help="Change one setting of every arm, e.g. training.steps=500."
    ),
]
Seeds = Annotated[int, typer.Option(min=1, max=100, help="Runs of every arm, each with another seed.")]
Quick = Annotated[bool, typer.Option("--quick", help="A few arms, two seeds and few steps: takes minutes.")]


@study.command("grouping")
def study_grouping(
    scene: Scene,
    home: Home = DEFAULT_HOME,
    preset: Preset = None,
    set_: Set = [],
    seeds: Seeds = 3,
    quick: Quick = False,
    as_json: AsJson = False,
) -> None:
    """Ways of grouping x K 20, 10, auto; then 3, 6, 9 input views for the best. The paper's first table.

    Killed half way? Run it again: outputs in the store are reused.
    """
    _study("grouping", scene, home, preset, set_, seeds, quick, as_json)


@study.command("augmentation")
def study_augmentation(
    scene: Scene,
    home: Home = DEFAULT_HOME,
    preset: Preset = None,
    set_: Set = [],
    seeds: Seeds = 3,
    quick: Quick = False,
    as_json: AsJson = False,
) -> None:
    """Real photographs, virtual views, and both x K 20, 10, auto; and how many virtual views. The paper's second table.

    Killed half way? Run it again: outputs in the store are reused.
    """
    _study("augmentation", scene, home, preset, set_, seeds, quick, as_json)


def _study(
    table: str,
    scene: str,
    home: Path,
    preset: str | None,
    overrides: list[str],
    seeds: int,
    quick: bool,
    as_json: bool,
) -> None:
    from aug3d_core.studies.named import Asked
    from aug3d_core.studies.paper.page import publication

    with typed_errors(as_json, home, goes_on=True), using(home) as store:
        console = Console(stderr=True)
        given = {
            "study": table,
            "scene": scene,
            "seeds": seeds,
            "quick": quick,
            "preset": preset,
            "overrides": overrides,
        }
        asked = Asked(name="paper", given=given)
        found = carry_out(store, f"{table} of {scene}", asked, asked.prepared(store), console, _outcome)
        finish(store, console, publication(found), as_json, lambda: print_findings(Console(), found))
        raise typer.Exit(3 if found.failed else 0)


def _outcome(result: PaperResult) -> str:
    return result.failure or f"{result.mean('psnr'):.2f} dB in {result.seconds:.0f} s"


@contextmanager
def using(home: Path) -> Iterator[Store]:
    """Open the store to write to it, and keep its objects while the block runs."""
    store = Store(home)
    store.check_writable()
    with store.using():
        yield store


def carry_out(
    store: Store,
    name: str,
    asked: Asked,
    prepared: Prepared[FoundT],
    console: Console,
    outcome: Callable[[Any], str],
) -> FoundT:
    """Carry a study out within a flow, and show how far it is. outcome: a result in a few words."""
    limits_from(os.environ)  # a wrong one is told before anything is started
    scheduler_from(os.environ)
    check_servers()
    apply_local_environment(store.root)
    watch = _Watch(console, prepared.cells, outcome)
    with prefect_server(store.root) as wait_until_ready:
        from flows.study_run import as_flow  # Prefect and MLflow read their settings when they are imported

        wait_until_ready()
        with watch:
            return as_flow(store, name, watch, asked, prepared, watch.done)


def publish(store: Store, console: Console, study: Publication) -> Path:
    """Write a study and log it to MLflow; return its folder."""
    from aug3d_core.studies.common.write import write_study
    from tasks.studies import log_study

    folder = write_study(store, study)
    console.print(f"logging {len(study.cells):,} runs to MLflow ...", highlight=False)
    if why := log_study(store, study, folder):
        console.print(f"[yellow]note[/] {escape(why)}", highlight=False, soft_wrap=True)
    return folder


def finish(store: Store, console: Console, study: Publication, as_json: bool, show: Callable[[], None]) -> None:
    """Write a study and log it to MLflow; print its data as JSON, or what `show` prints, and where it is."""
    folder = publish(store, console, study)
    if as_json:
        print(json.dumps({**study.data, "folder": str(folder)}, indent=1))
    else:
        show()
        print_folder(folder)


def print_folder(folder: Path) -> None:
    """Print where a study is."""
    console = Console()
    console.print(f"page, chart and data: {folder}", highlight=False, soft_wrap=True, markup=False)
    story = folder.parents[1] / layout.STORY
    console.print(f"all studies on one page: {story}", highlight=False, soft_wrap=True, markup=False)


class _Watch:
    """A progress listener for studies: a bar on a terminal, a line for each cell elsewhere."""

    def __init__(self, console: Console, cells: int | None, outcome: Callable[[Any], str]) -> None:
        """Prepare a bar for a number of cells, None if nobody knows it yet. outcome: a result in a few words."""
        self._console, self._outcome = console, outcome
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
        self._row = self._bar.add_task("", total=cells or 1, what="")

    def __enter__(self) -> _Watch:
        """Begin to draw."""
        self._bar.start()
        return self

    def __exit__(self, *_: object) -> None:
        """Leave the last state on the screen."""
        self._bar.stop()

    def started(self, step: str) -> None:
        """Name the current step."""
        self._bar.update(self._row, what=step)

    def advanced(self, step: str, done: int, total: int, what: str) -> None:
        """Show how far the current step is."""
        self._bar.update(self._row, what=f"{step}: {done} of {total} {what}")

    def finished(self, made: Visit) -> None:
        """A step is not shown when it is finished: cells are."""

    def done(self, result: Result[Any], cells: int, total: int) -> None:
        """Count a cell, and print its outcome."""
        self._bar.update(self._row, completed=cells, total=total, what="")
        self._console.print(
            f"{time.strftime('%H:%M:%S')} [{cells}/{total}] {result.cell.name}: {self._outcome(result)}",
            markup=False,
            highlight=False,
            soft_wrap=True,
        )


def print_findings(console: Console, found: PaperFindings) -> None:
    """Print the rows, the orderings and the warnings."""
    from aug3d_core.studies.paper.page import FIGURES, difference_text, figures

    console = widened(console)
    for part, rows in found.parts.items():
        table = Table("arm", title=f"{part}; PSNR in dB")
        for heading in FIGURES:
            table.add_column(heading, justify="right")
        for row in rows:
            table.add_row(row.name, *figures(row))
        console.print(table)
    verdicts = Table("statement", "on this scene", "difference", title=found.table.question)
    for judged in found.orderings:
        differences = "\n".join(f"{difference_text(d)} over {d.second}" for d in judged.differences)
        verdicts.add_row(judged.ordering.claim, judged.verdict, differences)
    console.print(verdicts)
    for row in found.rows:
        for note in row.notes:
            console.print(f"note {row.name}: {note}", markup=False, highlight=False)
