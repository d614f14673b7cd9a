"""A scene is read as it was written; what a run did not come to is named, and the rest is there."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from aug3d_core.dataset.scene import SPLITS
from aug3d_core.run.errors import UsageError
from aug3d_core.store.scenes import last_version, object_of
from aug3d_core.store.store import Store
from aug3d_core.view.finished import READ, photograph, read_finished
from tests.view.finished_scene import SIZE_PX, finished_scene


def folders(home: Path) -> Callable[[str], Path]:
    store = Store(home)
    version = last_version(store, "toy")

    def folder_of(step: str) -> Path:
        record = object_of(store, version, step)
        return store.files_dir(record, record.named(READ))

    return folder_of


def test_everything_is_read(tmp_path: Path) -> None:
    scene = finished_scene(tmp_path)
    folder_of = folders(tmp_path)
    shown = read_finished("toy", folder_of)
    assert len(shown.views) == 36 and not shown.lacks and shown.unplaced == 0
    assert list(shown.roles) == [SPLITS[one] for one in scene.splits[:36]]
    assert shown.names[7] == "drone_7.jpg"
    assert all(row in scene.groups["real"][shown.group[row]] for row in np.flatnonzero(shown.group >= 0))
    assert set(np.flatnonzero(shown.group >= 0)) == set(np.unique(scene.groups["real"]))
    assert np.nanmax(shown.error_px) == pytest.approx(0.5)
    assert shown.domes is not None and len(shown.domes) == len(scene) - 36
    assert tuple(shown.domes.size[0]) == SIZE_PX
    assert shown.mesh_glb.startswith(b"glTF")
    assert (folder_of("sfm") / photograph(7)).is_file()


def test_what_a_run_did_not_come_to_is_named(tmp_path: Path) -> None:
    finished_scene(tmp_path, without=("grouping", "sampling", "surface"))
    shown = read_finished("toy", folders(tmp_path))
    assert [one.split()[4].rstrip(":") for one in shown.lacks] == ["grouping", "sampling", "surface"]
    assert set(shown.roles) == {""} and (shown.group == -1).all()
    assert shown.domes is None and not shown.mesh_glb


def test_without_poses_there_is_nothing_to_see(tmp_path: Path) -> None:
    finished_scene(tmp_path, without=("sfm",))
    with pytest.raises(UsageError, match="has no sfm"):
        read_finished("toy", folders(tmp_path))
