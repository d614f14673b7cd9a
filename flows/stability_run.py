"""The study of stability as a Prefect flow, for those who start it in the Prefect UI."""

from __future__ import annotations

from typing import Annotated

from prefect import flow
from prefect.client.schemas.objects import State
from prefect.states import Completed, Failed
from pydantic import Field

from aug3d_core.bench.machine import describe_machine
from aug3d_core.stability.catalogue import cells_of, chosen
from aug3d_core.stability.cell import Result
from aug3d_core.stability.findings import findings
from aug3d_core.stability.run import run_cells
from aug3d_core.stability.write import write_study
from aug3d_core.store.store import Store
from flows.settings import home
from tasks import artifacts
from tasks.alive import alive
from tasks.progress import listening, reporter
from tasks.study_stability import log_stability


@flow(name="stability", flow_run_name="where methods break")
def stability(
    only: Annotated[list[str], Field(description="Only perturbations with words that begin so; none: all.")] = [],
    seeds: Annotated[int, Field(ge=1, le=100, description="Runs of every cell, each with a seed of its own.")] = 3,
    quick: Annotated[bool, Field(description="A few perturbations, harmless and ruinous, one seed: minutes.")] = False,
) -> State:
    """Find where each method breaks, and whether the factory notices; what was made before is found again."""
    store, runs = Store(home()), 1 if quick else seeds
    cells = cells_of(chosen(only, quick), runs, quick)
    with alive(store.root), store.using():
        with listening(artifacts.PrefectProgress()):
            results = run_cells(store, cells, _say, _done)
        found = findings("chosen" if only else "quick" if quick else "full", runs, describe_machine(), results)
        folder = write_study(store, found)
        why = log_stability(store, found, folder)
        artifacts.publish_study(folder, "Where does each method break, and does the factory notice?")
    told = f"{folder}; {why}" if why else str(folder)
    if found.silent or found.crashes:
        return Failed(message=f"{len(found.silent)} silent failures and {len(found.crashes)} crashes; {told}")
    return Completed(message=f"{len(results)} cells, none silent; {told}")


def _say(stage: str, done: int, total: int, what: str) -> None:
    reporter(stage)(done, total, what)


def _done(result: Result, cells: int, total: int) -> None:
    reporter("cells")(cells, total, result.cell.name)
