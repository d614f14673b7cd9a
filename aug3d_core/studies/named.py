"""The studies by their names and what they are asked for with: whoever is told both can make cells of one, on any machine."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Generic, TypeVar

from aug3d_core.collections.files import COLLECTIONS
from aug3d_core.collections.made import make_data
from aug3d_core.factory.scheduler import asking, obey, scheduler_from
from aug3d_core.factory.walk import Make
from aug3d_core.heads.config import names
from aug3d_core.run.errors import UsageError
from aug3d_core.run.stage import Frozen
from aug3d_core.scene_files.files import REGISTRY, read_each
from aug3d_core.scene_files.mirror import SharedFiles, take, to_share
from aug3d_core.store.store import Store
from aug3d_core.studies.common.cell import Done, make_cells
from aug3d_core.studies.common.trial import directly
from aug3d_core.studies.generalisation.cells import cells_of as generalised_cells
from aug3d_core.studies.generalisation.cells import make_cell as make_generalised
from aug3d_core.studies.generalisation.findings import GeneralisationFindings
from aug3d_core.studies.generalisation.findings import findings as generalisation_findings
from aug3d_core.studies.paper.arm import fitting
from aug3d_core.studies.paper.augmentation import augmentation_table
from aug3d_core.studies.paper.effort import repeats, study_effort
from aug3d_core.studies.paper.findings import PaperFindings
from aug3d_core.studies.paper.findings import findings as paper_findings
from aug3d_core.studies.paper.grouping import grouping_table
from aug3d_core.studies.paper.scene import open_finished
from aug3d_core.studies.paper.tables import make_table
from aug3d_core.studies.tradeoff.scene import open_studied
from aug3d_core.studies.tradeoff.study import TradeoffFindings, study_scene

if TYPE_CHECKING:
    from aug3d_core.studies.stability.findings import StabilityFindings

FoundT = TypeVar("FoundT")
_TABLES = {"grouping": grouping_table, "augmentation": augmentation_table}


@dataclass(frozen=True)
class Prepared(Generic[FoundT]):
    """A study whose words are right.

    cells: how many it has, None if that depends on what comes out. carry_out: makes them and says what was found; it wants
    what makes a step, who is told of each cell, and this machine in words.
    """

    cells: int | None
    carry_out: Callable[[Make, Done[Any], str], FoundT]


def paper(
    store: Store,
    study: str,
    scene: str,
    seeds: int,
    quick: bool,
    preset: str | None = None,
    overrides: Sequence[str] = (),
) -> Prepared[PaperFindings]:
    """Prepare one of the paper's tables on a finished scene; raises an error for a scene or a setting that is none."""
    opened = study_effort(open_finished(store, scene, preset), quick, overrides)
    table, runs = fitting(_TABLES[study](quick), opened.settings), repeats(seeds, quick)

    def carry_out(make: Make, done: Done[Any], machine: str) -> PaperFindings:
        results = make_table(store, table, opened, runs, make, done)
        return paper_findings(table, opened, runs, results, machine)

    return Prepared(len(table.arms) * runs * opened.folds, carry_out)


def tradeoff(
    store: Store,
    scene: str,
    seeds: int,
    target_db: float | None,
    search: bool,
    only: Sequence[str],
    quick: bool,
    preset: str | None = None,
    overrides: Sequence[str] = (),
) -> Prepared[TradeoffFindings]:
    """Prepare a chart of speed against accuracy; raises an error for a scene or a setting that is none."""
    opened = open_studied(store, scene, preset).with_settings(overrides)
    opened.config()
    runs = 1 if quick else seeds
    return Prepared(
        None, lambda make, done, _: study_scene(store, opened, quick, runs, target_db, search, make, done, only)
    )


def stability(store: Store, only: Sequence[str], seeds: int, quick: bool) -> Prepared[StabilityFindings]:
    """Prepare the study of where methods break; raises an error for words that no perturbation begins with."""
    # Its methods bring Open3D, which the other studies do without
    from aug3d_core.studies.stability.catalogue import cells_of, chosen, size_of
    from aug3d_core.studies.stability.cell import make_cell
    from aug3d_core.studies.stability.findings import findings

    runs = 1 if quick else seeds
    cells = cells_of(chosen(only, quick), runs, quick)

    def carry_out(make: Make, done: Done[Any], machine: str) -> StabilityFindings:
        results = make_cells(store, cells, lambda cell: make_cell(store, cell, make), done)
        return findings(size_of(only, quick), runs, machine, results)

    return Prepared(len(cells), carry_out)


def generalisation(store: Store, collection: str, head: Sequence[str], seeds: int) -> Prepared[GeneralisationFindings]:
    """Prepare leaving each scene of a collection out; raises an error for a head, or a collection, that is none."""
    entry = COLLECTIONS.read(store, collection)
    if unknown := [name for name in head if name not in names()]:
        raise UsageError(f"there is no head {unknown[0]!r}", f"choose of {', '.join(names())}")
    if not (entry.train or entry.hold_out):
        raise UsageError(f"collection {collection!r} has no scene to leave out", "name some under train or hold_out")
    cells = generalised_cells(entry, tuple(head) or names(), seeds)

    def carry_out(make: Make, done: Done[Any], machine: str) -> GeneralisationFindings:
        made = make_data(store, entry, read_each(store), lambda of: make)
        results = make_cells(store, cells, lambda cell: make_generalised(store, entry, made, cell, make), done)
        return generalisation_findings(collection, seeds, machine, results)

    return Prepared(len(cells), carry_out)


_STUDIES: dict[str, Callable[..., Prepared[Any]]] = {
    made.__name__: made for made in (paper, tradeoff, stability, generalisation)
}
_OF_SCENE_FILES = (tradeoff.__name__, generalisation.__name__)  # the others read no file that people edit
_REGISTRIES = (REGISTRY, COLLECTIONS)


class Asked(Frozen):
    """A study as it was asked for: its name, and the arguments of the function of that name."""

    name: str
    given: dict[str, Any]

    def prepared(self, store: Store) -> Prepared[Any]:
        """Prepare it in a store."""
        return _STUDIES[self.name](store, **self.given)

    @contextmanager
    def over_cluster(self, store: Store) -> Iterator[None]:
        """Have the workers of the Dask cluster, if AUG3D_DASK names one, make cells too, while the block runs."""
        if address := scheduler_from(os.environ):
            files = to_share(store, _REGISTRIES) if self.name in _OF_SCENE_FILES else None
            with asking(__name__, _Order(asked=self, files=files).model_dump_json(), address, after_s=0.0):
                yield
        else:
            yield


class _Order(Frozen):
    """What a worker of the cluster is asked for. files: what the study's names mean where it was asked for."""

    asked: Asked
    files: SharedFiles | None


def _make_cells(store: Store, ordered: str) -> None:
    order = _Order.model_validate_json(ordered)
    if order.files and order.files.files != to_share(store, _REGISTRIES).files:  # they may be this home's own
        take(store, order.files, _REGISTRIES)
    prepared = order.asked.prepared(store)
    prepared.carry_out(directly(store, lambda *_: None), lambda *_: None, "")


if __name__ == "__main__":
    obey(_make_cells)
