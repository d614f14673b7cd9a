"""`aug3d study stability`: at which dose each method breaks, and whether the factory notices."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated

import typer
from rich.console import Console
from rich.table import Table

from flows.options import DEFAULT_HOME, AsJson, Home
from flows.refusal import typed_errors
from flows.study import Seeds, carry_out, finish, using
from flows.words import widened

if TYPE_CHECKING:
    from aug3d_core.studies.stability.cell import StabilityResult
    from aug3d_core.studies.stability.findings import StabilityFindings


def study_stability(
    home: Home = DEFAULT_HOME,
    only: Annotated[
        list[str],
        typer.Option(metavar="WORDS", help="Only perturbations with words that begin with these; repeatable."),
    ] = [],
    seeds: Seeds = 3,
    quick: Annotated[
        bool, typer.Option("--quick", help="A few perturbations, harmless and ruinous, one seed: takes minutes.")
    ] = False,
    as_json: AsJson = False,
) -> None:
    """Worse and worse photographs, poses, meshes and settings: where each method breaks, and what is noticed (a night).

    It needs no finished scene: small towns and exact worlds are made for it. Exit code 3 if a failure is silent or
    something crashes. Killed half way? Run it again: outputs in the store are reused.
    """

    from aug3d_core.studies.named import Asked
    from aug3d_core.studies.stability.page import publication

    with typed_errors(as_json, home, goes_on=True), using(home) as store:
        console = Console(stderr=True)
        asked = Asked(name="stability", given={"only": only, "seeds": seeds, "quick": quick})
        found = carry_out(store, "where methods break", asked, asked.prepared(store), console, _outcome)
        finish(store, console, publication(store, found), as_json, lambda: print_findings(Console(), found))
        raise typer.Exit(3 if found.silent or found.crashes else 0)


def _outcome(result: StabilityResult) -> str:
    judge = result.arm.perturbation.judge
    figure = "no figure" if result.accuracy is None else f"{judge.name} {result.accuracy:.3g}"
    return f"{figure}{', broken' if result.broken else ''}; {result.state}{', SILENT' if result.silent else ''}"


def print_findings(console: Console, found: StabilityFindings) -> None:
    """Print where each method breaks, and what is silent or crashed."""
    console = widened(console)
    table = Table("perturbation", "method", "harmless dose", "breaks at", "state there", "first reported at")
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
    counts["false alarms"] = found.false_alarms
    console.print("; ".join(f"{len(of)} {name}" for name, of in counts.items()), highlight=False)
