"""The figures of a test that was made in folds: every view of every fold counts alike."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import pandas as pd

from aug3d_core.factory.plan import stage_and_fold
from aug3d_core.factory.stages import EVALUATION
from aug3d_core.judging.files import TEST_VIEWS
from aug3d_core.judging.summary import summary
from aug3d_core.photos.files import PHOTO_TABLE, read_photos
from aug3d_core.run.errors import StoreError
from aug3d_core.store.record import Record
from aug3d_core.store.store import Store


def pooled(evaluations: Sequence[tuple[Record, Path]]) -> dict[str, Any]:
    """Return the figures of evaluations, each with the folder of its files; those of one are its own."""
    first, _ = evaluations[0]
    if len(evaluations) == 1:
        return first.metrics
    views = test_views([folder for _, folder in evaluations])
    photographs = [record.metrics.get("test_photos") for record, _ in evaluations]
    return summary(views) | {
        "head": first.metrics.get("head"),
        "conventions": first.metrics.get("conventions"),
        "test_photos": _digest(photographs) if all(photographs) else None,
    }


def test_views(folders: Sequence[Path]) -> pd.DataFrame:
    """Return the tables of test views one under the other, with the `fold`; a group is never part of two folds."""
    tables = [pd.read_parquet(folder / TEST_VIEWS).assign(fold=fold) for fold, folder in enumerate(folders)]
    joined = pd.concat(tables, ignore_index=True)
    return joined.assign(group=joined.groupby(["fold", "group"]).ngroup())


def psnr_by_photo(store: Store, records: Mapping[str, Record]) -> dict[str, float]:
    """Return the PSNR of each test photograph [dB], in the order of the flight, by fold and digest; {} where files are gone.

    records: of a version's steps.
    """
    tests = [record for step, record in records.items() if stage_and_fold(step)[0] == EVALUATION.name]
    if not tests or "photos" not in records:
        return {}
    try:
        photos = read_photos(store.files_dir(records["photos"], [PHOTO_TABLE])).set_index("photo_id")["sha256"]
        views = test_views([store.files_dir(record, [TEST_VIEWS]) for record in tests])
    except StoreError:
        return {}
    names = views["fold"].astype(str) + " " + photos.loc[views["photo_id"]].to_numpy()
    return dict(zip(names, views["psnr"].astype(float), strict=True))


def _digest(parts: Sequence[Any]) -> str:
    return hashlib.sha256("\n".join(map(str, parts)).encode()).hexdigest()
