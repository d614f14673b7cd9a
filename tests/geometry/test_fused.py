"""Fused points are the same whether a file of them is read whole or in parts."""

from __future__ import annotations

from dataclasses import fields
from pathlib import Path

import numpy as np
import pytest

from aug3d_core.geometry.fused import Fused


def cloud(count: int) -> Fused:
    rng = np.random.default_rng(0)
    xyz, normals = rng.normal(size=(2, count, 3)).astype(np.float32)
    return Fused(xyz, normals, rng.integers(0, 256, (count, 3), np.uint8), rng.integers(2, 9, count, np.uint8))


@pytest.mark.parametrize("count", [0, 1, 7, 77])
def test_parts_together_are_the_whole(count: int, tmp_path: Path) -> None:
    whole = cloud(count)
    whole.save(tmp_path / "fused.npz")
    parts = [*Fused.parts(tmp_path / "fused.npz", 7)]
    assert [len(part.xyz) for part in parts] == [7] * (count // 7) + [count % 7] * (count % 7 > 0)
    for field in fields(Fused) if parts else ():
        joined = np.concatenate([getattr(part, field.name) for part in parts])
        assert (joined == getattr(whole, field.name)).all() and joined.dtype == getattr(whole, field.name).dtype


def test_points_by_columns_are_refused(tmp_path: Path) -> None:
    some = cloud(9)
    Fused(np.asfortranarray(some.xyz), some.normals, some.rgb, some.views).save(tmp_path / "fused.npz")
    with pytest.raises(ValueError, match="by columns"):
        next(Fused.parts(tmp_path / "fused.npz", 4))
