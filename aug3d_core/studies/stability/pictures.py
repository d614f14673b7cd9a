"""Pictures of failures: the first dose at which a method breaks, beside the harmless one."""

from __future__ import annotations

from pathlib import Path

from aug3d_core.store.record import Record
from aug3d_core.store.store import Store
from aug3d_core.studies.stability.cell import StabilityResult
from aug3d_core.studies.stability.perturbation import InFactory


def picture_of(store: Store, result: StabilityResult) -> tuple[Path, str] | None:
    """Return a picture of a cell and its caption: of the stage that shows it best, else of the last stage with one."""
    how = result.arm.perturbation.how
    wanted = how.picture if isinstance(how, InFactory) else "computed"
    records = [record for record in result.records.values() if record.pictures]
    if not records:
        return None
    record = result.records.get(wanted, records[-1])
    return _first(store, record if record.pictures else records[-1])


def _first(store: Store, record: Record) -> tuple[Path, str]:
    caption, path = next(iter(record.pictures.items()))
    return store.file(record, path), caption
