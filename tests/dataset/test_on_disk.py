"""Pictures on disk are indexed as they are in memory, in bounded memory, and damage in them is found."""

from __future__ import annotations

import numpy as np
import pytest

from aug3d_core.dataset.on_disk import Cache, OnDisk
from aug3d_core.dataset.reader import read
from aug3d_core.dataset.scene import PICTURES
from aug3d_core.dataset.writer import write
from aug3d_core.run.errors import InputError
from tests.toy_scene import toy_scene

KEYS = [
    3,
    np.int32(5),
    slice(2, 9, 3),
    np.array([4, 1, 4]),
    np.array([[0, 5, 5], [7, 2, 1]]),
    np.array([], int),
    (np.array([], int), slice(0, 3)),
    (7, slice(2, 6), slice(1, 5)),
    (np.array([3, 8]), slice(0, 4)),
    (np.array([3, 3, 8]), np.array([0, 1, 7]), np.array([11, 0, 5])),
]


@pytest.fixture(scope="module")
def scene():
    return toy_scene(0, 12, 8)


@pytest.fixture(scope="module")
def store(scene, tmp_path_factory):
    path = tmp_path_factory.mktemp("packed") / "scene.zarr"
    write(scene, path, shard_views=16)
    return path


@pytest.mark.parametrize("limit_bytes", [1, 3000, 2**30])
@pytest.mark.parametrize("name", PICTURES)
def test_it_is_indexed_as_in_memory(scene, store, name, limit_bytes):
    there = getattr(read(store, Cache(limit_bytes)), name)
    assert isinstance(there, OnDisk) and there.shape == getattr(scene, name).shape
    for key in KEYS:
        found, wanted = there[key], getattr(scene, name)[key]
        assert np.array_equal(found, wanted) and found.dtype == wanted.dtype


def test_memory_is_bounded_whatever_is_read(store):
    cache = Cache(5 * 12 * 8 * 3)  # five pictures
    scene = read(store, cache)
    for view in range(len(scene)):
        assert scene.images[view].any()
        assert cache.held_bytes <= cache.limit_bytes


def test_what_was_read_last_is_still_there(store):
    scene = read(store, Cache(5 * 12 * 8 * 3))
    scene.images.fetch(np.array([9, 10]))
    once = scene.images[9]
    assert np.shares_memory(scene.images[9], once)


def test_scenes_share_a_cache_and_not_their_pictures(store):
    cache = Cache(2**20)
    one, other = read(store, cache), read(store, cache)
    assert np.array_equal(one.images[2], other.images[2])
    assert not np.shares_memory(one.images[2], other.images[2])


def test_a_damaged_picture_is_found_when_the_scene_is_opened(scene, tmp_path):
    path = tmp_path / "scene.zarr"
    write(scene, path, shard_views=16)
    shard = max((path / "images" / "c").rglob("*"), key=lambda file: file.stat().st_size if file.is_file() else 0)
    content = bytearray(shard.read_bytes())
    content[50] ^= 255
    shard.write_bytes(content)
    with pytest.raises(InputError, match="array images"):
        read(path, Cache(2**20))
