"""`aug3d compare`: what differs between runs in settings and figures, for people who live in the terminal."""

from __future__ import annotations

import json
import re
from collections.abc import Sequence
from dataclasses import asdict
from string import ascii_uppercase
from typing import Annotated, Any

import typer
from rich.console import Console
from rich.markup import escape
from rich.table import Table

from aug3d_core.metrics.comparison import PSNR, Comparison, Row, Side, change_text, compare, psnr_words, side
from aug3d_core.metrics.pooled import psnr_by_photo
from aug3d_core.run.errors import UsageError
from aug3d_core.store import layout
from aug3d_core.store.published import RULES
from aug3d_core.store.scenes import records_of, scenes, version_metrics
from aug3d_core.store.store import Store
from aug3d_core.store.version_name import find_version
from flows.options import DEFAULT_HOME, AsJson, Home
from flows.reading import read_store
from flows.refusal import typed_errors
from flows.settings import apply_local_environment
from flows.words import figure, widened
from tasks.mlflow_outbox import waiting

_RUN_ID = re.compile(r"[0-9a-f]{4,32}")


def compare_runs(
    runs: Annotated[
        list[str],
        typer.Argument(
            metavar="RUN RUN...",
            help="SCENE (its newest version), SCENE@published, SCENE@2026-11-21 (as much of the time as says which), "
            "or the beginning of an MLflow run id.",
        ),
    ],
    equal_too: Annotated[bool, typer.Option("--all", help="Also show what is the same in all runs.")] = False,
    home: Home = DEFAULT_HOME,
    as_json: AsJson = False,
) -> None:
    """Show what differs between runs: settings, figures, and which is better where that is known.

    The first run is what the others are compared with: aug3d compare town@published town.
    """
    with typed_errors(as_json, home):
        if not 2 <= len(runs) <= len(ascii_uppercase):
            raise UsageError(
                f"{len(runs)} run to compare" if len(runs) == 1 else f"{len(runs)} runs are too many",
                f"name two or more, for example {runs[0].partition('@')[0]}@published {runs[0]}",
            )
        store = read_store(home)
        _tell_what_waits(store)
        compared = compare([_side(store, run) for run in runs], equal_too=equal_too)
        if as_json:
            print(json.dumps(asdict(compared), indent=1))
        else:
            _print(widened(Console()), compared, equal_too)


def _tell_what_waits(store: Store) -> None:
    """Tell MLflow what it could not be told at its time, and say what came of it; costs nothing where nothing waits.

    Not from a store that can only be read: what was told would be told again.
    """
    if store.unwritable() or not waiting(store):
        return
    apply_local_environment(store.root)
    from tasks.tracking import flush  # MLflow reads its settings when it is imported

    flushed, console = flush(store), Console(stderr=True)
    if flushed.runs:
        console.print(f"logged to MLflow: {', '.join(flushed.runs)}", style="dim", highlight=False)
    if flushed.waiting:
        console.print(f"[yellow]note[/] {escape(flushed.waiting)}", highlight=False, soft_wrap=True)


def _side(store: Store, run: str) -> Side:
    if "@" in run or run in scenes(store) or not _RUN_ID.fullmatch(run):
        version = find_version(store, run)
    else:
        apply_local_environment(store.root)
        from tasks.logged_runs import logged_run

        logged = logged_run(store, run)
        version = store.root / layout.SCENES / logged.tags.get("scene", "") / logged.tags.get("version", "")
        if "version" not in logged.tags or not (version / layout.METRICS).is_file():
            about = {
                what: logged.tags[what] for what in ("scene", "state", "preset", "git", *RULES) if what in logged.tags
            }
            return Side(f"{logged.name} ({run})", about, logged.params, logged.metrics)
    metrics = version_metrics(version)
    records = records_of(store, metrics)
    return side(f"{version.parent.name}@{version.name}", metrics, records, psnr_by_photo(store, records))


def _print(console: Console, compared: Comparison, equal_too: bool) -> None:
    console.print(_runs_table(compared))
    console.print(_verdict(compared), highlight=False)
    for letter, steps in zip(ascii_uppercase, compared.lacks, strict=False):
        if steps:
            console.print(f"{letter} has no {', '.join(dict.fromkeys(steps))}", highlight=False)
    console.print(_table("held-out photographs, seconds, memory", compared, compared.headline))
    for title, rows in (("settings", compared.params), ("figures", compared.metrics)):
        if rows:
            console.print(_table(title if equal_too else f"{title} that differ", compared, rows))
        else:
            console.print(f"{title}: no difference")


def _runs_table(compared: Comparison) -> Table:
    shown = [row for row in compared.about if row.name not in ("scene", *RULES)]
    table = Table("", "run", *(row.name for row in shown))
    for letter, place in zip(ascii_uppercase, range(len(compared.runs)), strict=False):
        table.add_row(letter, compared.runs[place], *(_text(row.values[place]) for row in shown))
    return table


def _verdict(compared: Comparison) -> str:
    if compared.not_comparable:
        return f"[yellow]the scores cannot be compared[/]: {escape(compared.not_comparable)}"
    told = [
        f"{letter} against A: {words}" for place, letter in _others(compared) if (words := psnr_words(compared, place))
    ]
    return "\n".join(["the scores can be compared: the same test photographs and rules", *map(escape, told)])


def _table(title: str, compared: Comparison, rows: Sequence[Row]) -> Table:
    """Return a row per name: the first run's value, and of each other run its value and how far that is from the first."""
    table = Table(title=title)
    table.add_column("", no_wrap=True)
    table.add_column("A", justify="right")
    for _, letter in _others(compared):
        table.add_column(letter, justify="right")
        table.add_column(f"{letter} against A", justify="right")
    for row in rows:
        cells = [_cell(compared, row, 0)]
        for place, _ in _others(compared):
            cells += [_cell(compared, row, place), _change(row, place)]
        table.add_row(row.name, *cells)
    return table


def _others(compared: Comparison) -> list[tuple[int, str]]:
    return list(enumerate(ascii_uppercase[: len(compared.runs)]))[1:]


def _cell(compared: Comparison, row: Row, place: int) -> str:
    interval = compared.psnr_intervals[place]
    if row.name != PSNR or interval is None:
        return escape(_text(row.values[place]))
    return escape(f"{row.values[place]:.2f} [{interval[0]:.2f}, {interval[1]:.2f}]")


def _change(row: Row, place: int) -> str:
    better = row.better[place]
    if better is None:
        return change_text(row, place)
    colour, word = ("green", "better") if better else ("red", "worse")
    return f"[{colour}]{f'{change_text(row, place)} {word}'.strip()}[/]"


def _text(value: Any) -> str:
    whole = isinstance(value, float) and value.is_integer()  # MLflow knows no integers
    return str(int(value)) if whole else figure(value)
