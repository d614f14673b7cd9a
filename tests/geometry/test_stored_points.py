"""Stored points are the same whether their file is read whole, in parts or by tiles, and joined files are one file."""

from __future__ import annotations

from dataclasses import fields
from pathlib import Path

import numpy as np
import pytest

from aug3d_core.geometry import stored_points
from aug3d_core.geometry.fused import Fused
from aug3d_core.geometry.ground_tiles import EVERYWHERE, Tile
from aug3d_core.geometry.stored_points import IndexedPoints, StoredPoints, join_points
from tests.geometry.test_fused import cloud

NAMES = [field.name for field in fields(Fused)]


def stored(points: Fused, folder: Path, name: str = "fused.npz") -> StoredPoints:
    points.save(folder / name)
    return StoredPoints.open(folder / name)


def same(one: Fused, other: Fused) -> None:
    for name in NAMES:
        np.testing.assert_array_equal(getattr(one, name), getattr(other, name))
        assert getattr(one, name).dtype == getattr(other, name).dtype


@pytest.mark.parametrize("count", [0, 1, 7, 77])
def test_parts_together_are_the_whole(count: int, tmp_path: Path) -> None:
    whole = cloud(count)
    file = stored(whole, tmp_path)
    assert len(file) == count
    parts = [*file.parts(7)]
    assert [len(part.xyz) for part in parts] == [7] * (count // 7) + [count % 7] * (count % 7 > 0)
    for name in NAMES if parts else ():
        joined = np.concatenate([getattr(part, name) for part in parts])
        np.testing.assert_array_equal(joined, getattr(whole, name))
    same(file.rows(0, count), whole)
    np.testing.assert_array_equal(file.xyz(3, 5), whole.xyz[3:5])


def test_points_by_columns_or_packed_are_refused(tmp_path: Path) -> None:
    some = cloud(9)
    with pytest.raises(ValueError, match="by columns"):
        stored(Fused(np.asfortranarray(some.xyz), some.normals, some.rgb, some.views), tmp_path)
    np.savez_compressed(tmp_path / "packed.npz", **{name: getattr(some, name) for name in NAMES})
    with pytest.raises(ValueError, match="packed"):
        StoredPoints.open(tmp_path / "packed.npz")


def test_a_file_that_was_cut_off_since_is_refused(tmp_path: Path) -> None:
    file = stored(cloud(99), tmp_path)
    file.path.write_bytes(file.path.read_bytes()[:700])
    with pytest.raises(ValueError, match=r"reshape|buffer"):
        file.rows(0, 99)


@pytest.mark.parametrize("sorted_by_x", [True, False])
def test_a_tile_is_read_exactly_whatever_the_order(
    sorted_by_x: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(stored_points, "BLOCK", 10)
    whole = cloud(305)
    whole.xyz[[3, 40], 0] = np.nan
    whole.xyz[50:60] = np.inf  # a block of which nothing lies anywhere
    if sorted_by_x:
        order = np.argsort(whole.xyz[:, 0])
        whole = Fused(*(getattr(whole, name)[order] for name in NAMES))
    indexed = IndexedPoints.of(stored(whole, tmp_path))
    x = float(np.sort(whole.xyz[:, 0])[100])  # a border on a point, which belongs to what is above
    for tile in (*EVERYWHERE.halves(0, x), Tile((-0.3, -0.2), (0.4, x)), Tile((50.0, 50.0), (60.0, 60.0))):
        same(indexed.over(tile), whole.take(tile.holds(whole.xyz)))
    if sorted_by_x:
        below = indexed.meeting(EVERYWHERE.halves(0, x)[0])
        assert 10 <= below.sum() <= 13, "blocks that lie beyond the border are not read"


def test_joined_files_are_the_bytes_of_one(tmp_path: Path) -> None:
    parts = [cloud(count) for count in (5, 0, 70_000)]
    join_points([stored(part, tmp_path, f"{number}.npz") for number, part in enumerate(parts)], tmp_path / "joined.npz")
    whole = Fused(*(np.concatenate([getattr(part, name) for part in parts]) for name in NAMES))
    whole.save(tmp_path / "whole.npz")
    assert (tmp_path / "joined.npz").read_bytes() == (tmp_path / "whole.npz").read_bytes()
    same(Fused.load(tmp_path / "joined.npz"), whole)
