"""Pictures that are made when they are asked for: as an array of them would be, and no more at once than a shard."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from aug3d_core.dataset.by_view import OnDemand, joined
from aug3d_core.dataset.reader import read
from aug3d_core.dataset.scene import PICTURES
from aug3d_core.dataset.writer import write
from tests.toy_scene import toy_scene

WHOLE = np.arange(5 * 2 * 3, dtype=np.uint8).reshape(5, 2, 3)


def on_demand(values: np.ndarray, asked: list[int] | None = None) -> OnDemand:
    def make(view: int) -> np.ndarray:
        if asked is not None:
            asked.append(view)
        return values[view]

    return OnDemand(len(values), values.shape[1:], values.dtype, make)


@pytest.mark.parametrize("views", [0, -1, slice(1, 3), slice(None), slice(3, 99), np.array([4, 0]), slice(0, 0)])
def test_it_is_indexed_as_an_array_of_them(views: int | slice | np.ndarray) -> None:
    found = on_demand(WHOLE)[views]
    assert found.dtype == WHOLE.dtype and np.array_equal(found, WHOLE[views])


def test_two_are_one_after_the_other() -> None:
    both = joined(on_demand(WHOLE), on_demand(WHOLE[::-1]))
    assert np.array_equal(np.asarray(both), np.concatenate([WHOLE, WHOLE[::-1]]))
    assert len(joined(on_demand(WHOLE), on_demand(WHOLE[:0]))) == 5


def test_a_view_that_is_not_there_is_not_made() -> None:
    with pytest.raises(IndexError):
        on_demand(WHOLE)[5]


def test_a_scene_is_packed_shard_by_shard_and_is_the_same(tmp_path: Path) -> None:
    scene, asked = toy_scene(0, 24, 18), []
    lazy = replace(scene, **{name: on_demand(getattr(scene, name), asked) for name in PICTURES})
    said: list[int] = []
    write(lazy, tmp_path / "lazy.zarr", 4, said.append)
    write(scene, tmp_path / "whole.zarr", 4)
    for name in PICTURES:
        assert np.array_equal(getattr(read(tmp_path / "lazy.zarr"), name), getattr(scene, name))
    files = {
        path.relative_to(tmp_path / "whole.zarr"): path.read_bytes()
        for path in (tmp_path / "whole.zarr").rglob("*")
        if path.is_file()
    }
    assert all((tmp_path / "lazy.zarr" / name).read_bytes() == content for name, content in files.items())
    shards = [view // 4 for view in asked]
    assert shards == sorted(shards), "nothing of a shard is asked for when the next has begun"
    assert len(asked) == len(PICTURES) * len(scene) and said == [*range(0, len(scene), 4), len(scene)]
