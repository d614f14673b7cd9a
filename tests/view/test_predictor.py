"""What the viewer predicts is what the head predicts of the same view, and it follows the camera."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import torch

from aug3d_core.heads.head import build
from aug3d_core.heads.pixelnerf.head import PixelNerfHead
from aug3d_core.run.errors import InputError
from aug3d_core.view.poses import Pose, intrinsics_of
from aug3d_core.view.predictor import Predictor, halved
from tests.engines.toy_training import HEAD
from tests.toy_scene import toy_scene
from tests.view.finished_scene import CONFIG, SIZE_PX


@pytest.fixture(scope="module")
def predictor() -> Predictor:
    torch.manual_seed(0)
    return Predictor(toy_scene(0, *SIZE_PX), build(CONFIG).eval(), 3)


def at(predictor: Predictor, row: int, aside: float = 0.0) -> Pose:
    pose = predictor.scene.world_from_cam[row].copy()
    pose[0, 3] += aside
    return Pose(pose, predictor.fov_rad)


def test_a_view_is_the_head_s_and_comes_again(predictor: Predictor) -> None:
    first, again = predictor.predict(at(predictor, 8)), predictor.predict(at(predictor, 8))
    assert np.array_equal(first.colour, again.colour)
    assert first.colour.shape == (48, 64, 3) and len(first.photo_ids) == 3 and 8 not in first.photo_ids
    assert first.depth is not None and first.seen is not None and first.seen.mean() > 0.5


def test_the_scaffold_is_the_depth_that_the_photograph_has_there(predictor: Predictor) -> None:
    """The row itself is no input: its own scaffold is the truth of what the others' points look like from there."""
    scene, row = predictor.scene, 8
    pose = at(predictor, row)
    given = predictor._candidates.chosen(pose.world_from_cam, intrinsics_of(pose.fov_rad, SIZE_PX), 3)
    made = predictor._with_view(given, pose, quick=False, half=False).scaffold[-1].astype(float)
    truth = scene.scaffold[row].astype(float)
    known = made > 0
    assert known.mean() > 0.8
    assert np.median(np.abs(made - truth)[known]) < 0.3
    filled = predictor._with_view(given, pose, quick=True, half=False).scaffold[-1]
    assert (filled > 0).all() and np.array_equal(filled[known], made.astype(filled.dtype)[known])


def test_it_follows_the_camera(predictor: Predictor) -> None:
    here, aside = (predictor.predict(at(predictor, 8, by)).colour.astype(int) for by in (0.0, 6.0))
    assert np.abs(here - aside).mean() > 5


def test_a_moving_view_may_be_half_as_large(predictor: Predictor) -> None:
    view = predictor.predict(at(predictor, 8), quick=True, half=True)
    assert view.colour.shape == (24, 32, 3) and view.half
    whole = predictor.predict(at(predictor, 8)).colour.astype(float).reshape(24, 2, 32, 2, 3).mean(axis=(1, 3))
    assert np.abs(whole - view.colour).mean() < np.abs(whole - whole.mean(axis=(0, 1))).mean()


def test_into_the_sky_there_is_nothing(predictor: Predictor) -> None:
    pose = at(predictor, 8)
    pose.world_from_cam[:3, 1:3] *= -1
    with pytest.raises(InputError, match="no photograph shows"):
        predictor.predict(pose)


def test_half_a_scene_shows_the_same(predictor: Predictor) -> None:
    names = ("images", "alpha", "depth", "scaffold", "baseline_images", "baseline_alpha")
    whole = replace(
        predictor.scene, **{name: np.asarray(getattr(predictor.scene, name))[:, :47, :63] for name in names}
    )
    small = halved(whole)
    assert small.images.shape == (len(whole), 23, 31, 3) and small.alpha.min() == 255
    assert np.allclose(small.images[3, 4, 5], whole.images[3, 8:10, 10:12].mean(axis=(0, 1)), atol=0.51)
    assert np.allclose(small.intrinsics * 2, whole.intrinsics)


def test_a_frozen_encoder_encodes_inputs_once_while_the_camera_moves_about_them() -> None:
    torch.manual_seed(0)
    head = build(HEAD.model_copy(update={"encoder_frozen": True, "even_exposure": False})).eval()
    predictor, encoded = Predictor(toy_scene(0, *SIZE_PX), head, 3), []
    assert isinstance(head, PixelNerfHead)
    head.encoder.register_forward_hook(lambda _, images, __: encoded.append(len(images[0])))
    first, aside = (predictor.predict(at(predictor, 8, by), half=True) for by in (0.0, 0.2))
    assert first.photo_ids == aside.photo_ids and not np.array_equal(first.colour, aside.colour)
    assert encoded == [3]
