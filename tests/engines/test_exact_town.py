"""A town packed from its truth, with real Cycles: what it says of depth and poses is so, and a head learns from it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from aug3d_core.dataset.files import SCENE_ZARR
from aug3d_core.dataset.projection import project
from aug3d_core.dataset.rays import view_rays
from aug3d_core.dataset.reader import read
from aug3d_core.dataset.scene import RENDERED, SPLITS
from aug3d_core.run.errors import InputError
from aug3d_core.town.config import TownConfig
from aug3d_core.town.exact.config import ExactTownConfig
from aug3d_core.town.exact.stage import run

CONFIG = ExactTownConfig(
    town=TownConfig(
        length_m=80, width_m=70, altitude_m=45, width_px=160, samples=2, max_photos=8, terrain="slope", season="winter",
        noise_levels=0.5, blur_px=0.0,
    ),
    k=4,
    exposure_spread=0.05,
)  # fmt: skip


@pytest.fixture(scope="module")
def packed(tmp_path_factory) -> Path:
    out = tmp_path_factory.mktemp("exact")
    outcome = run({}, CONFIG, out, lambda *_: None)
    assert outcome.metrics["views"] == outcome.metrics["groups_rendered"] == 8
    assert (out / next(iter(outcome.pictures.values()))).exists()
    return out


@pytest.fixture(scope="module")
def scene(packed):
    return read(packed / SCENE_ZARR)


def test_it_is_a_data_set_to_train_on_alone(scene):
    assert scene.images.shape == (8, 120, 160, 3)
    assert (scene.source == RENDERED).all() and (scene.splits == SPLITS.index("train")).all()
    assert not len(scene.groups["test"]) and not len(scene.groups["real"])
    assert scene.groups["rendered"].shape == (8, 4)
    assert 60 < scene.images.mean() < 200


def test_a_pixel_is_the_mean_of_its_parts(scene):
    parts = scene.fine_images.reshape(8, 120, 2, 160, 2, 3)
    assert np.abs(parts.mean(axis=(2, 4)) - scene.images).max() <= 0.5
    assert parts.astype(float).std(axis=(2, 4)).mean() > 1, "they show more than it"


def test_what_a_view_shows_lies_in_the_slab(scene):
    for view in range(len(scene)):
        heights = scene.slab.height(points_of(scene, view))
        inside = (heights > scene.slab.low) & (heights < scene.slab.high)
        assert inside.mean() > 0.97


def test_views_of_one_place_agree_on_where_it_is_and_how_it_looks(scene):
    """Points of a view's depth, seen from the others of its group: nothing lies behind what these show, and most are there."""
    near, alike = [], []
    for first, *others in scene.groups["rendered"][:4]:
        points, colours = points_of(scene, int(first)), scene.images[first].reshape(-1, 3) / 255
        points, colours = points[::7], colours[::7]
        for other in others:
            xy, ahead = project(scene, int(other), points)
            inside = ahead & ((xy >= 0) & (xy < [160, 120])).all(axis=1)
            x, y = xy[inside].astype(int).T
            pose = scene.world_from_cam[other]
            along = (points[inside] - pose[:3, 3]) @ pose[:3, 2]
            met = scene.depth[other, y, x].astype(float)
            seen = np.abs(along - met) < 0.01 * met
            near.append(seen.mean())
            alike.append(np.abs(scene.images[other, y, x] / 255 - colours[inside]).mean(axis=1)[seen])
    assert np.mean(near) > 0.8
    assert np.median(np.concatenate(alike)) < 0.08


def test_it_repeats_to_the_bit(scene, tmp_path):
    run({}, CONFIG, tmp_path, lambda *_: None)
    again = read(tmp_path / SCENE_ZARR)
    assert all(
        np.array_equal(getattr(again, name), getattr(scene, name)) for name in ("images", "depth", "world_from_cam")
    )


@pytest.mark.parametrize(
    ("changes", "told"),
    [({"max_photos": 3}, "the flight has 3 photographs, a group has 4"), ({"radial_k1": 0.01}, "pinhole camera")],
)
def test_what_cannot_be_packed_is_refused(changes, told, tmp_path):
    config = CONFIG.model_copy(update={"town": CONFIG.town.model_copy(update=changes)})
    with pytest.raises(InputError, match=told):
        run({}, config, tmp_path, lambda *_: None)


def points_of(scene, view):
    rays = view_rays(scene, view, slab_bounds=False)
    depth = scene.depth[view].astype(float).ravel()
    return (rays.origins + depth[:, None] * rays.directions)[depth > 0]
