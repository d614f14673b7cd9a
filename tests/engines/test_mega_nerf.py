"""Mega-NeRF's `.pt` files: what is read from them, and how each kind of damage is told."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch

from aug3d_core.geometry.transforms import centres, forward
from aug3d_core.poses.entry import Entry
from aug3d_core.poses.mega_nerf import read_mega_nerf
from aug3d_core.poses.recognise import recognise
from aug3d_core.run.errors import InputError

pytestmark = pytest.mark.slow


def write(folder: Path, spoil: Callable[[dict[str, Any]], Any] = lambda content: content, **coordinates: Any) -> Path:
    """Write two photographs, the second as `spoil` makes it: cameras over the origin that look straight down."""
    for split, number in (("train", 0), ("val", 1)):
        metadata = folder / split / "metadata"
        metadata.mkdir(parents=True)
        # The world is x down, y right, z back. Looking down: right is y, the image's up is -z, back is up, so -x.
        content = {
            "W": 320,
            "H": 240,
            "c2w": torch.tensor([[0.0, 0, -1, -0.5], [1, 0, 0, 0.1 * number], [0, -1, 0, 0.2]]),
            "intrinsics": torch.tensor([300.0, 301, 160, 120]),
            "distortion": torch.tensor([0.1, 0.01, 0.001, 0.002]),
        }
        torch.save(spoil(content) if number else content, metadata / f"{number:06d}.pt")
    (folder / "mappings.txt").write_text("flight/a, b.jpg,000000.pt\nflight/c.jpg,000001.pt\n")
    torch.save(
        {"origin_drb": torch.tensor([-7.0, 8, 9]), "pose_scale_factor": 20.0, **coordinates}, folder / "coordinates.pt"
    )
    return folder


def read(folder: Path) -> list[Entry]:
    return read_mega_nerf(recognise(folder))


def test_a_camera_is_where_and_how_it_was(tmp_path: Path) -> None:
    second = read(write(tmp_path))[1]
    np.testing.assert_allclose(centres(second.cam_from_world), [-0.5 * 20 - 7, 0.1 * 20 + 8, 0.2 * 20 + 9], atol=1e-5)
    np.testing.assert_allclose(forward(second.cam_from_world), [1, 0, 0], atol=1e-9)
    np.testing.assert_allclose(second.cam_from_world[0, :3], [0, 1, 0], atol=1e-9)
    np.testing.assert_allclose(second.cam_from_world[1, :3], [0, 0, 1], atol=1e-9)


def test_raw_photographs_are_distorted_and_copies_are_not(tmp_path: Path) -> None:
    (raw_name, raw), (copy_name, copy) = read(write(tmp_path))[0].names
    assert (raw_name, copy_name) == ("flight/a, b.jpg", "train/rgbs/000000")
    assert (raw.model, copy.model) == ("OPENCV", "PINHOLE")
    assert raw.params == pytest.approx((300, 301, 160, 120, 0.1, 0.01, 0.001, 0.002))
    assert copy.params == (300, 301, 160, 120)


def test_without_mappings_only_the_copies_have_names(tmp_path: Path) -> None:
    (write(tmp_path) / "mappings.txt").unlink()
    assert [name for name, _ in read(tmp_path)[1].names] == ["val/rgbs/000001"]


class Evil:
    """Runs a program when it is unpickled."""

    def __init__(self, touched: Path) -> None:
        self.touched = touched

    def __reduce__(self) -> tuple:
        return os.system, (f"touch {self.touched}",)


def test_a_file_that_would_run_a_program_does_not(tmp_path: Path) -> None:
    write(tmp_path, lambda content: {**content, "c2w": Evil(tmp_path / "owned")})
    with pytest.raises(InputError, match=r"val/metadata/000001\.pt cannot be read as plain tensors"):
        read(tmp_path)
    assert not (tmp_path / "owned").exists()


def without(key: str) -> Callable[[dict[str, Any]], Any]:
    return lambda content: {name: value for name, value in content.items() if name != key}


@pytest.mark.parametrize(
    ("spoil", "words"),
    [
        (without("c2w"), "has no c2w"),
        (without("W"), "has no W"),
        (
            lambda content: {**content, "c2w": content["c2w"] * float("nan")},
            "c2w has values that are not finite numbers",
        ),
        (lambda content: {**content, "c2w": content["c2w"] * 3}, "not a rotation"),
        (lambda content: {**content, "c2w": torch.eye(3)}, r"c2w has shape \(3, 3\)"),
        (lambda content: {**content, "intrinsics": torch.ones(3)}, "not 4 finite numbers"),
        (lambda content: {**content, "H": [240, 240]}, "H is not one number"),
        (lambda content: {**content, "intrinsics": "wide"}, "intrinsics has values that are not finite numbers"),
        (lambda content: {**content, "distortion": torch.ones(8)}, "distortion has 8 values"),
        (lambda content: [content], "holds a list, not a dictionary"),
    ],
)
def test_a_corrupt_file(spoil: Callable[[dict[str, Any]], Any], words: str, tmp_path: Path) -> None:
    with pytest.raises(InputError, match=rf"val/metadata/000001\.pt.*{words}"):
        read(write(tmp_path, spoil))


def test_a_truncated_file(tmp_path: Path) -> None:
    file = write(tmp_path) / "train" / "metadata" / "000000.pt"
    file.write_bytes(file.read_bytes()[:300])
    with pytest.raises(InputError, match=r"000000\.pt cannot be read"):
        read(tmp_path)


def test_coordinates_that_are_missing_or_no_scale(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"coordinates\.pt: pose_scale_factor 0"):
        read(write(tmp_path, pose_scale_factor=0.0))
    (tmp_path / "coordinates.pt").unlink()
    with pytest.raises(InputError, match=r"coordinates\.pt is missing"):
        read(tmp_path)


def test_a_line_of_mappings_that_names_no_file(tmp_path: Path) -> None:
    write(tmp_path)
    (tmp_path / "mappings.txt").write_text("a.jpg,000000.pt\nb.jpg\n")
    with pytest.raises(InputError, match=r"mappings\.txt, line 2: 'b\.jpg'"):
        read(tmp_path)
