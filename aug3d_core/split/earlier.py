"""Find the test of a scene before it grew: the same photographs are then predicted, and its figures compare."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pandas as pd
from jaxtyping import Float
from scipy.spatial import KDTree

from aug3d_core.geometry.footprint import footprints_apart
from aug3d_core.split.files import SPLIT_TABLE
from aug3d_core.split.split import HeldOut, Role

_TESTED = (str(Role.SUPPORT), str(Role.TARGET))
_LEAST = 0.5  # of today's views, as for the poses that a scene grows from


def earlier_test(
    folder: Path | None,
    photo_sha256: Sequence[str],
    there: set[str],
    look_in_world: Float[np.ndarray, "n 2"],
    footprint: Float[np.ndarray, " n"],
    gap_footprints: float,
) -> HeldOut | None:
    """Return the test of the largest earlier split of a true part of today's photographs; the newest of equals.

    One of no fewer views counts only if its own test had been kept: another is simply chosen again from the same ground.
    A new view is of the block if the known one that looks nearest is, and it looks less than the gap from one of the block.
    folder: of grouping's earlier outputs. photo_sha256: of each view. there: of all photographs. footprint: in world units.
    None without such a split, where a photograph of its test has no pose, or where it has folds.
    """
    role = _largest(folder, set(photo_sha256), there)
    if not role:
        return None
    roles = np.array([role.get(sha256, "") for sha256 in photo_sha256])
    known, new = np.flatnonzero(roles != ""), np.flatnonzero(roles == "")
    block = np.isin(roles, _TESTED)
    apart = footprints_apart(look_in_world, footprint, new, np.flatnonzero(block)).min(axis=1)
    nearest = known[KDTree(look_in_world[known]).query(look_in_world[new])[1]]
    block[new] = block[nearest] & (apart < gap_footprints)
    return HeldOut(block, np.flatnonzero(roles == Role.TARGET))


def _largest(folder: Path | None, placed: set[str], there: set[str]) -> dict[str, str]:
    """Return the role of each photograph then; empty if there is no such split. placed: photographs with a pose today."""
    largest: dict[str, str] = {}
    for files in sorted(folder.iterdir()) if folder is not None and folder.exists() else []:
        was = pd.read_parquet(files / SPLIT_TABLE)
        grew = len(was) < len(placed) or ("test_kept" in was and bool(was["test_kept"].all()))
        if not grew or len(was) < max(_LEAST * len(placed), len(largest) + 1) or (was["folds"] != 1).any():
            continue
        role = dict(zip(was["photo_sha256"], was["role"].astype(str), strict=True))
        if set(role) <= there and {sha256 for sha256 in role if role[sha256] in _TESTED} <= placed:
            largest = role
    return largest
