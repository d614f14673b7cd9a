"""Find the test of a scene before it grew: the same photographs are then predicted, and its figures compare."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
import pandas as pd
from jaxtyping import Float
from scipy.spatial import KDTree

from aug3d_core.split.files import SPLIT_TABLE
from aug3d_core.split.split import HeldOut, Role

_LEAST = 0.5  # of today's views, as for the poses that a scene grows from


def earlier_test(
    folder: Path | None, photo_sha256: Sequence[str], there: set[str], look_in_world: Float[np.ndarray, "n 2"]
) -> HeldOut | None:
    """Return the test of the largest earlier split of a true part of today's photographs; the newest of equals.

    A new view is of the block if the known one that looks nearest is. folder: of grouping's earlier outputs. photo_sha256: of
    each view. there: of all photographs. None without such a split, where a photograph of its test has no pose, or where it
    has folds.
    """
    best, most = None, 0
    view_of = {sha256: view for view, sha256 in enumerate(photo_sha256)}
    for files in sorted(folder.iterdir()) if folder is not None and folder.exists() else []:
        was = pd.read_parquet(files / SPLIT_TABLE)
        if not max(_LEAST * len(view_of), most + 1) <= len(was) < len(view_of) or (was["folds"] != 1).any():
            continue
        role = dict(zip(was["photo_sha256"], was["role"].astype(str), strict=True))
        tested = {sha256 for sha256 in role if role[sha256] in (Role.SUPPORT, Role.TARGET)}
        if set(role) <= there and tested <= set(view_of):
            best, most = _today(role, tested, photo_sha256, look_in_world), len(role)
    return best


def _today(
    role: Mapping[str, str], tested: set[str], photo_sha256: Sequence[str], look_in_world: Float[np.ndarray, "n 2"]
) -> HeldOut:
    """Return a test by today's views. role: of each photograph, then. tested: the photographs of the block."""
    known = np.flatnonzero([sha256 in role for sha256 in photo_sha256])
    of_block = np.array([photo_sha256[view] in tested for view in known])
    block = of_block[KDTree(look_in_world[known]).query(look_in_world)[1]]
    block[known] = of_block  # two that look at one place may be of different parts
    return HeldOut(block, np.flatnonzero([role.get(sha256) == Role.TARGET for sha256 in photo_sha256]))
