"""`aug3d study generalisation`: each scene of a collection left out in turn."""

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
    from aug3d_core.studies.generalisation.cells import Generalised
    from aug3d_core.studies.generalisation.findings import GeneralisationFindings


def study_generalisation(
    collection: Annotated[str, typer.Argument(help="Name of a collection; see aug3d collections list.")],
    home: Home = DEFAULT_HOME,
    head: Annotated[list[str], typer.Option(help="Only this head; repeatable. Without it, all.")] = [],
    seeds: Seeds = 1,
    as_json: AsJson = False,
) -> None:
    """Leave each scene of a collection out: never seen, tuned for a tenth of the steps, trained on it alone (hours).

    Killed half way? Run it again: outputs in the store are reused. Exit code 3: some runs failed.
    """
    from aug3d_core.studies.generalisation.page import publication
    from aug3d_core.studies.named import Asked

    with typed_errors(as_json, home, goes_on=True), using(home) as store:
        given = {"collection": collection, "head": head, "seeds": seeds}
        console, asked = Console(stderr=True), Asked(name="generalisation", given=given)
        title = f"generalisation of {collection}"
        found = carry_out(store, title, asked, asked.prepared(store), console, _outcome)
        finish(store, console, publication(found), as_json, lambda: print_findings(Console(), found))
        raise typer.Exit(3 if found.failed else 0)


def _outcome(result: Generalised) -> str:
    if result.views is None:
        return result.failure
    return f"{result.views['psnr'].mean():.2f} dB, training {result.cpu_seconds:.0f} s"


def print_findings(console: Console, found: GeneralisationFindings) -> None:
    """Print the table, and the differences between ways."""
    from aug3d_core.judging.names import called
    from aug3d_core.studies.generalisation.findings import CHEAP, order
    from aug3d_core.studies.generalisation.page import HEADS, cells, over

    console = widened(console)
    table = Table(
        *HEADS[:3], title=f"generalisation of {found.collection}; leads over cheap answers in dB, 95 % intervals"
    )
    for heading in (*HEADS[3:], *map(called, CHEAP)):
        table.add_column(heading, justify="right")
    for row in sorted(found.rows, key=order):
        table.add_row(*cells(row), *over(row))
    console.print(table)
    for name, lead in found.against.items():
        console.print(f"{name}: {lead.text()} dB", markup=False, highlight=False)
    for row in found.silent:
        console.print(f"{row.scene}: never seen, no better than a cheap answer, and no warning", markup=False)
    for result in found.failed:
        console.print(f"{result.cell.name}: {result.failure}", markup=False, highlight=False)
