"""A binary model that COLMAP wrote is whole, and each part of one of its files is not."""

from __future__ import annotations

import struct
from pathlib import Path

import pycolmap
import pytest

from aug3d_core.poses.colmap_check import check_binary
from aug3d_core.run.errors import InputError

FILES = ("cameras", "images", "points3D", "rigs", "frames")


def camera(camera_id: int) -> pycolmap.Camera:
    return pycolmap.Camera(camera_id=camera_id, model="PINHOLE", width=4, height=3, params=[4, 4, 2, 1.5])


@pytest.fixture
def written(tmp_path: Path) -> Path:
    """Write two photographs of one camera that see a point, and a rig of three cameras, of which one has no pose."""
    model = pycolmap.Reconstruction()
    model.add_camera_with_trivial_rig(camera(1))
    for image_id in (1, 2):
        image = pycolmap.Image(f"{image_id}.jpg", [[1.0, 2.0]], camera_id=1, image_id=image_id)
        model.add_image_with_trivial_frame(image, pycolmap.Rigid3d())
    track = pycolmap.Track()
    track.add_element(1, 0), track.add_element(2, 0)
    model.add_point3D([0.0, 0.0, 9.0], track)
    rig, sensors = pycolmap.Rig(rig_id=2), [pycolmap.sensor_t(pycolmap.SensorType.CAMERA, i) for i in (1, 2, 3)]
    model.add_camera(camera(2)), model.add_camera(camera(3))
    rig.add_ref_sensor(sensors[0]), rig.add_sensor(sensors[1], pycolmap.Rigid3d()), rig.add_sensor(sensors[2], None)
    model.add_rig(rig)
    model.write_binary(tmp_path)
    return tmp_path


def test_a_model_that_colmap_wrote_is_whole(written: Path) -> None:
    assert {path.stem for path in written.iterdir()} == set(FILES)
    check_binary(written)


@pytest.mark.parametrize("name", FILES)
def test_no_part_of_a_file_is_whole(name: str, written: Path) -> None:
    file = written / f"{name}.bin"
    whole = file.read_bytes()
    for length in range(len(whole)):
        file.write_bytes(whole[:length])
        with pytest.raises(InputError, match=rf"{name}\.bin is damaged"):
            check_binary(written)


@pytest.mark.parametrize("name", FILES)
def test_more_records_than_there_are_is_damage(name: str, written: Path) -> None:
    file = written / f"{name}.bin"
    file.write_bytes(struct.pack("<Q", 2**60) + file.read_bytes()[8:])
    with pytest.raises(InputError, match=rf"{name}\.bin is damaged"):
        check_binary(written)
