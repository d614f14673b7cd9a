import json
import shutil
from filecmp import cmp

import numpy as np
import pytest
import zarr

from aug3d_core.dataset.reader import read
from aug3d_core.dataset.writer import arrays_of, write
from aug3d_core.run.errors import InputError
from tests.toy_scene import toy_scene


@pytest.fixture(scope="module")
def scene():
    return toy_scene(0, 12, 8)


@pytest.fixture
def store(scene, tmp_path):
    write(scene, tmp_path / "scene.zarr", shard_views=16)
    return tmp_path / "scene.zarr"


def test_what_is_written_is_read(scene, store):
    again = read(store)
    for name, values in arrays_of(scene).items():
        assert np.array_equal(arrays_of(again)[name], values)
        assert arrays_of(again)[name].dtype == values.dtype
    assert (again.slab, again.scale) == (scene.slab, scene.scale)


def test_plain_zarr_reads_it_view_by_view(scene, store):
    root = zarr.open(store, mode="r")
    assert root["images"].chunks == (1, 8, 12, 3)
    assert root["images"].shards == (16, 8, 12, 3)
    assert np.array_equal(root["images"][7], scene.images[7])
    assert np.array_equal(root["groups/test/members"][:], scene.groups["test"])


def test_the_same_scene_has_the_same_bytes(scene, store, tmp_path):
    write(scene, tmp_path / "again.zarr", shard_views=16)
    files = sorted(path.relative_to(store) for path in store.rglob("*") if path.is_file())
    assert files == sorted(
        p.relative_to(tmp_path / "again.zarr") for p in (tmp_path / "again.zarr").rglob("*") if p.is_file()
    )
    assert all(cmp(store / name, tmp_path / "again.zarr" / name, shallow=False) for name in files)


def test_a_store_of_another_version_is_refused(store):
    path = store / "zarr.json"
    head = json.loads(path.read_text())
    head["attributes"]["version"] = 99
    path.write_text(json.dumps(head))
    with pytest.raises(InputError, match="version 99"):
        read(store)


def test_a_store_cut_short_is_refused(store):
    path = store / "zarr.json"
    path.write_text(json.dumps(json.loads(path.read_text()) | {"attributes": {}}))
    with pytest.raises(InputError, match="version none"):
        read(store)


def test_a_missing_shard_is_found_where_zarr_would_answer_zeros(store):
    (store / "images/c/1/0/0/0").unlink()
    with pytest.raises(InputError, match="array images"):
        read(store)


def test_a_damaged_shard_is_found(store):
    path = store / "images/c/0/0/0/0"
    path.write_bytes(path.read_bytes()[:-30] + bytes(30))
    with pytest.raises(InputError, match="array images"):
        read(store)


def test_a_missing_array_is_named(store):
    shutil.rmtree(store / "near_far")
    with pytest.raises(InputError, match="near_far"):
        read(store)


def test_no_store_is_refused(tmp_path):
    with pytest.raises(InputError, match="no Zarr v3 store"):
        read(tmp_path / "nothing.zarr")
