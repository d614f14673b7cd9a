"""Views, points and tracks come back as they went, and their files' bytes depend on the arrays alone."""

from __future__ import annotations

from filecmp import cmp
from pathlib import Path

import numpy as np
import pytest

from aug3d_core.geometry.views import Points, Tracks, Views


def some_views(count: int = 3) -> Views:
    rng = np.random.default_rng(1)
    return Views(
        photo_id=np.arange(count) * 2,
        cam_from_world=rng.normal(size=(count, 3, 4)),
        intrinsics=rng.uniform(1, 9, size=(count, 4)),
        size=np.tile([11, 7], (count, 1)),
    )


def test_views_come_back(tmp_path: Path) -> None:
    views = some_views()
    views.save(tmp_path / "views.npz")
    loaded = Views.load(tmp_path / "views.npz")
    for name in ("photo_id", "cam_from_world", "intrinsics", "size"):
        np.testing.assert_array_equal(getattr(loaded, name), getattr(views, name))
        assert getattr(loaded, name).dtype == getattr(views, name).dtype


def test_empty_points_and_tracks_come_back(tmp_path: Path) -> None:
    Points(np.zeros((0, 3)), np.zeros((0, 3), np.uint8), np.zeros(0)).save(tmp_path / "points.npz")
    Tracks(np.zeros(0, int), np.zeros(0, int), np.zeros((0, 2))).save(tmp_path / "tracks.npz")
    assert Points.load(tmp_path / "points.npz").xyz.shape == (0, 3)
    assert Tracks.load(tmp_path / "tracks.npz").xy.shape == (0, 2)


def test_bytes_repeat(tmp_path: Path) -> None:
    some_views().save(tmp_path / "a.npz")
    some_views().save(tmp_path / "b.npz")
    assert cmp(tmp_path / "a.npz", tmp_path / "b.npz", shallow=False)


def test_a_missing_array_is_an_error(tmp_path: Path) -> None:
    np.savez(tmp_path / "views.npz", photo_id=np.arange(3))
    with pytest.raises(KeyError):
        Views.load(tmp_path / "views.npz")


def test_pickles_are_refused(tmp_path: Path) -> None:
    np.savez(tmp_path / "tracks.npz", point=np.array([{}], dtype=object), view=np.zeros(1), xy=np.zeros((1, 2)))
    with pytest.raises(ValueError, match="pickle"):
        Tracks.load(tmp_path / "tracks.npz")


def test_take_keeps_rows_together() -> None:
    views = some_views(5)
    taken = views.take(np.array([4, 0]))
    assert len(taken) == 2
    np.testing.assert_array_equal(taken.photo_id, [8, 0])
    np.testing.assert_array_equal(taken.cam_from_world[0], views.cam_from_world[4])
