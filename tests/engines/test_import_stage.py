"""Photographs that contradict their given poses are left out until the others agree, or all are refused."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pandas as pd
import pycolmap
import pytest

from aug3d_core.geometry.camera_models import Camera
from aug3d_core.photos.files import image_name
from aug3d_core.poses.files import Given
from aug3d_core.run.errors import InputError
from aug3d_core.sfm import export
from aug3d_core.sfm.import_stage import Check, agreeing

CAMERA = Camera("PINHOLE", 400, 300, (350.0, 350.0, 200.0, 150.0))
GIVEN = [Given(i, np.eye(3, 4), CAMERA, CAMERA, i) for i in range(10)]
PHOTOS = pd.DataFrame({"photo_id": range(10), "name": [f"{i}.jpg" for i in range(10)]})
UNKNOWN = float("nan")


def told(*rounds: dict[int, float], pointless: int | None = None) -> Check:
    """Return a check that says in each round how some photographs fit, and 0.9 of the others.

    pointless: number of the round in which no point is left.
    """
    left = list(rounds)

    def build(given: Sequence[Given]) -> pycolmap.Reconstruction:
        model = pycolmap.Reconstruction()
        model.add_camera_with_trivial_rig(
            pycolmap.Camera(camera_id=1, model="PINHOLE", width=4, height=3, params=[4, 4, 2, 1.5])
        )
        for one in given:
            image = pycolmap.Image(image_name(one.photo_id), camera_id=1, image_id=one.photo_id + 1)
            model.add_image_with_trivial_frame(image, pycolmap.Rigid3d())
        if len(rounds) - len(left) != pointless:
            model.add_point3D(np.ones(3), pycolmap.Track())
        return model

    def fit(model: pycolmap.Reconstruction) -> np.ndarray:
        now = left.pop(0)
        return np.array([now.get(export.photo_id(image), 0.9) for image in export.registered(model)])

    return Check(build, fit, 0.5, "likeness")


def test_all_that_agree_are_kept() -> None:
    model, fit, refused = agreeing(GIVEN, told({}), PHOTOS)
    assert (model.num_reg_images(), len(fit), refused) == (10, 10, [])


def test_what_fits_worse_without_the_first_that_are_wrong_is_left_out_too() -> None:
    model, fit, refused = agreeing(GIVEN, told({7: 0.1}, {3: 0.2, 4: 0.6}, {}), PHOTOS)
    assert refused == [3, 7]
    assert sorted(map(export.photo_id, export.registered(model))) == [0, 1, 2, 4, 5, 6, 8, 9]
    assert len(fit) == 8 and fit.min() >= 0.5


@pytest.mark.parametrize(
    ("check", "words"),
    [
        (told(dict.fromkeys(range(6), 0.3)), "6 of 10 do not fit, 0.jpg first"),
        (told({7: 0.1}, {i: 0.05 * i for i in range(1, 6)}), "6 of 10 do not fit, 1.jpg first"),
        (told({7: 0.1}, dict.fromkeys(range(8), UNKNOWN)), "1 of 10 do not fit, 7.jpg first"),
        (told({7: 0.1}, {}, pointless=1), "1 of 10 do not fit, 7.jpg first"),
        (told(dict.fromkeys(range(8), UNKNOWN)), "of 10 photographs only 2 share enough"),
    ],
    ids=[
        "most at once",
        "most in the end",
        "too few can be told in the end",
        "no points in the end",
        "too few can be told",
    ],
)
def test_poses_of_other_photographs_are_refused(check: Check, words: str) -> None:
    with pytest.raises(InputError, match=words):
        agreeing(GIVEN, check, PHOTOS)
