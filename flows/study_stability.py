"""`aug3d study stability`: every method at the place where it breaks, and whether the factory notices."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.console import Console
from rich.markup import escape
from rich.table import Table

from aug3d_core.store import layout
from aug3d_core.store.store import Store
from flows.preflight import check_servers
from flows.refusal import typed_errors
from flows.settings import apply_local_environment
from flows.study import HOME, AsJson, Home, Seeds, Watch

if TYPE_CHECKING:
    from aug3d_core.stability.cell import Result
    from aug3d_core.stability.findings import Findings

_WIDTH = 140


def study_stability(
    home: Home = HOME,
    only: Annotated[
        list[str], typer.Option(metavar="WORDS", help="Only perturbations with words that begin so; repeatable.")
    ] = [],
    seeds: Seeds = 3,
    quick: Annotated[
        bool, typer.Option("--quick", help="A few perturbations, harmless and ruinous, one seed: minutes, for a look.")
    ] = False,
    as_json: AsJson = False,
) -> None:
    """Worse and worse photographs, poses, meshes and settings: where does each method break, and who notices? (a night)

    It needs no finished scene: small towns and exact worlds are made for it. Exit code 3 if a failure is silent or
    something crashes. Killed half way? Run it again: what was made is found again.
    """
    from aug3d_core.bench.machine import describe_machine
    from aug3d_core.stability.catalogue import cells_of, chosen
    from aug3d_core.stability.findings import as_json as data
    from aug3d_core.stability.findings import findings
    from aug3d_core.stability.run import run_cells
    from aug3d_core.stability.write import write_study

    with typed_errors(as_json):
        store, runs = Store(home), 1 if quick else seeds
        cells = cells_of(chosen(only, quick), runs, quick)
        size = "chosen" if only else "quick" if quick else "full"
        with store.using():
            check_servers()
            apply_local_environment(store.root)
            console = Console(stderr=True)
            with Watch(console, len(cells)) as watch:
                results = run_cells(store, cells, watch.say, _counting(watch))
            found = findings(size, runs, describe_machine(), results)
            folder = write_study(store, found)
            from tasks.study_stability import log_stability  # Prefect and MLflow read their settings when imported

            console.print(
                f"map, page and data are written; telling MLflow of {len(results):,} runs ...", highlight=False
            )
            if why := log_stability(store, found, folder):
                console.print(f"[yellow]note[/] {escape(why)}", highlight=False, soft_wrap=True)
            if as_json:
                print(json.dumps(data(found) | {"folder": str(folder)}, indent=1))
            else:
                print_findings(Console(), found, folder)
        raise typer.Exit(3 if found.silent or found.crashes else 0)


def _counting(watch: Watch):
    def done(result: Result, cells: int, total: int) -> None:
        judge = result.cell.perturbation.judge
        figure = "no figure" if result.accuracy is None else f"{judge.name} {result.accuracy:.3g}"
        broken = ", broken" if result.broken else ""
        silent = ", SILENT" if result.silent else ""
        watch.count(result.cell.name, f"{figure}{broken}; {result.state}{silent}", cells, total)

    return done


def print_findings(console: Console, found: Findings, folder: Path) -> None:
    """Print where each method breaks, what is silent or crashed, and where the study is."""
    if not console.is_terminal:
        console.width = max(console.width, _WIDTH)
    table = Table("perturbation", "method", "undisturbed", "breaks at", "and then is", "first noticed at")
    last = ""
    for row in found.rows:
        breaking, noticed, unit = row.breaking, row.noticed, row.perturbation.dose_unit
        name = row.perturbation.name if row.perturbation.name != last else ""
        last = row.perturbation.name
        start = row.doses[0].accuracy
        table.add_row(
            name,
            row.method,
            "-" if start is None else f"{start:.3g}",
            f"{breaking.dose:g} {unit}" if breaking else "never",
            ("silent" if breaking.silent else breaking.state) if breaking else "",
            f"{noticed.dose:g} {unit}" if noticed else "never",
        )
    console.print(table)
    for result in (*found.silent, *found.crashes):
        what = "crash" if result.state == "crash" else "silent"
        console.print(f"{what}: {result.cell.name} {result.failure}", markup=False, highlight=False)
    counts = {"cells": found.results, "silent failures": found.silent, "crashes": found.crashes}
    counts["alarms without cause"] = found.false_alarms
    console.print("; ".join(f"{len(of)} {name}" for name, of in counts.items()), highlight=False)
    console.print(f"page, map and data: {folder}", highlight=False, soft_wrap=True)
    console.print(f"all studies on one page: {folder.parents[1] / layout.STORY}", highlight=False, soft_wrap=True)
