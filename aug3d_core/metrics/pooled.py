"""The figures of a test that was made in folds: every view of every fold counts alike."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import pandas as pd

from aug3d_core.judging.files import TEST_VIEWS
from aug3d_core.judging.summary import summary
from aug3d_core.store.record import Record


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


def _digest(parts: Sequence[Any]) -> str:
    return hashlib.sha256("\n".join(map(str, parts)).encode()).hexdigest()
