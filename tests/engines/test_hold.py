"""Earlier poses that are kept, or not, for what GPS and control points tell of a grown scene."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pandas as pd
import pycolmap
import pytest

from aug3d_core.geometry.geodesy import geodetic_from_enu
from aug3d_core.geometry.similarity import fit_similarity
from aug3d_core.sfm import export, straighten
from aug3d_core.sfm.camera_model import EXIF, Chosen
from aug3d_core.sfm.files import POINTS, TRACKS, VIEWS, WORLD
from aug3d_core.sfm.grow import Earlier
from aug3d_core.sfm.hold import hold
from aug3d_core.sfm.write import align_model, world_record
from tests.engines.test_control_adjustment import ORIGIN, bend_m, flight

OLD = 34  # of 42 photographs


@pytest.fixture(autouse=True)
def turned_by_hand(monkeypatch: pytest.MonkeyPatch) -> None:
    """Cameras that tell nothing, so that all is left to GPS: the flight's are hung too well."""
    monkeypatch.setattr(straighten, "doming_by_gimbal", lambda poses: None)


def photographs(at: np.ndarray, seed: int, noise_m: float) -> pd.DataFrame:
    noise = np.random.default_rng(seed).normal(size=at.shape) * noise_m
    table = pd.DataFrame(geodetic_from_enu(at + noise + [0, 0, 37], ORIGIN), columns=["lat_deg", "lon_deg", "alt_m"])
    return table.assign(photo_id=range(len(at)), sha256=[str(i) for i in range(len(at))], focal_px=np.nan)


def begun(whole: pycolmap.Reconstruction) -> pycolmap.Reconstruction:
    """Return a model of the earlier photographs alone."""
    cut = pycolmap.Reconstruction(whole)
    for image in export.registered(whole)[OLD:]:
        cut.deregister_frame(cut.image(image.image_id).frame_id)
    model = pycolmap.Reconstruction()
    model.add_camera_with_trivial_rig(whole.camera(1))
    for image in export.registered(cut):
        keypoints = np.array([point.xy for point in image.points2D])
        entry = pycolmap.Image(image.name, keypoints, camera_id=1, image_id=image.image_id)
        model.add_image_with_trivial_frame(entry, image.cam_from_world())
    for point in (cut.point3D(point_id) for point_id in sorted(cut.point3D_ids())):
        if point.track.length() >= 2:
            model.add_point3D(point.xyz, point.track, point.color)
    return model


def aligned(model: pycolmap.Reconstruction, photos: pd.DataFrame, folder: Path) -> Earlier:
    """Return a model as one that was made before of these photographs."""
    located, arrays = align_model(
        model, photos, None, np.random.default_rng(0), Chosen(model, "SIMPLE_RADIAL", EXIF, {})
    )
    arrays.views.save(folder / VIEWS)
    arrays.points.save(folder / POINTS)
    arrays.tracks.save(folder / TRACKS)
    (folder / WORLD).write_text(json.dumps(world_record(located)))
    return Earlier(model, folder, {i: i for i in range(len(photos))}, {}, len(photos))


def mapped_about(earlier: Earlier, whole: pycolmap.Reconstruction) -> pycolmap.Reconstruction:
    grown, there = pycolmap.Reconstruction(whole), sorted(earlier.model.reg_image_ids())
    fit = fit_similarity(
        *(np.array([model.image(one).projection_center() for one in there]) for model in (grown, earlier.model))
    )
    grown.transform(pycolmap.Sim3d(fit.scale, pycolmap.Rotation3d(fit.rotation), fit.translation))
    return grown


@pytest.mark.parametrize("seed", [2, 3])
def test_poses_move_where_more_photographs_make_a_bend_sure(seed: int, tmp_path: Path) -> None:
    whole, _, at = flight(-0.06, held=True)
    photos = photographs(at, seed, 2.0)
    earlier = aligned(begun(whole), photos[:OLD], tmp_path)
    was_m = bend_m(earlier.model, at[:OLD])
    assert was_m > 0.5, "bent, and nothing told it surely"
    held, found = hold(mapped_about(earlier, whole), earlier, photos, None, 0)
    assert held is None and "GPS altitudes now tell a bend of -3" in found


def test_a_straight_flight_is_kept(tmp_path: Path) -> None:
    whole, _, at = flight(-0.06, held=False)
    photos = photographs(at, 0, 1.0)
    earlier = aligned(begun(whole), photos[:OLD], tmp_path)
    held, _ = hold(mapped_about(earlier, whole), earlier, photos, None, 0)
    assert held and len(held.arrays.views) == len(at) and bend_m(held.model, at) < 0.2


def test_control_points_move_poses_only_where_they_tell_a_world(tmp_path: Path) -> None:
    whole, marks, at = flight(-0.06, held=False)
    photos = photographs(at, 0, 1.0)
    earlier = aligned(begun(whole), photos[:OLD], tmp_path)
    grown = mapped_about(earlier, whole)
    assert hold(grown, earlier, photos, marks, 0) == (None, "control points move all poses")
    held, _ = hold(grown, earlier, photos, marks[marks["point"] == "P0"], 0)
    assert held and "3 are needed" in held.located.problem, "and it is said why they are not used"
