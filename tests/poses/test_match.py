"""Names in a pose file find their photographs, or it is said whose poses they are not."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

from aug3d_core.geometry.camera_models import Camera
from aug3d_core.poses.entry import Entry
from aug3d_core.poses.match import match_photos
from aug3d_core.run.errors import InputError

CAMERA = Camera("PINHOLE", 400, 300, (350.0, 350.0, 200.0, 150.0))


def table(*names: str, original: tuple[int, int] = (400, 300), working: tuple[int, int] = (400, 300)) -> pd.DataFrame:
    return pd.DataFrame(
        {
            "photo_id": range(len(names)),
            "name": names,
            "width_px": working[0],
            "height_px": working[1],
            "original_width_px": original[0],
            "original_height_px": original[1],
        }
    )


def entries(*names: str, camera: Camera = CAMERA) -> list[Entry]:
    return [Entry(((name, camera),), np.eye(3, 4), f"file, image {i}", i) for i, name in enumerate(names)]


def found(names: list[str], photos: pd.DataFrame) -> dict[int, int]:
    return {one.source_id: one.photo_id for one in match_photos(entries(*names), photos)}


def test_file_names_agree_whatever_the_folders_and_their_case() -> None:
    photos = table("a.jpg", "b.JPG", "flight/c.jpg")
    assert found(["images/A.jpg", "./b.jpg", "d:\\photos\\c.jpg"], photos) == {0: 0, 1: 1, 2: 2}


def test_letters_with_marks_agree_however_they_are_composed() -> None:
    """Files copied from a Mac have the letter and the mark apart (NFD); most others have one character (NFC)."""
    composed, apart = "M\u00fcggelsee/\u00c9.jpg", "mu\u0308ggelsee/e\u0301.JPG"
    for there, here in ((composed, apart), (apart, composed)):
        photos = table("b.jpg", here, "lake/" + here.rpartition("/")[2], "c.jpg")
        assert found(["b.jpg", there, "c.jpg"], photos) == {0: 0, 1: 1, 2: 3}


def test_a_name_with_another_ending_or_none() -> None:
    assert found(["x.png", "train/rgbs/y", "z.jpg"], table("x.jpg", "y.jpg", "z.jpg")) == {0: 0, 1: 1, 2: 2}


def test_folders_tell_photographs_of_one_name_apart() -> None:
    photos = table("mon/1.jpg", "tue/1.jpg", "tue/2.jpg", "wed/3.jpg")
    assert found(["all/tue/1.jpg", "mon/1.jpg", "2.jpg"], photos) == {0: 1, 1: 0, 2: 2}


def test_a_name_that_may_be_two_photographs() -> None:
    with pytest.raises(InputError, match=r"file, image 0 matches several photographs: mon/1.jpg, tue/1.jpg"):
        found(["1.jpg", "2.jpg", "3.jpg"], table("mon/1.jpg", "tue/1.jpg", "2.jpg", "3.jpg"))


def test_two_poses_of_one_photograph() -> None:
    with pytest.raises(InputError, match=r"image 1 and file, image 0 are both the photograph 1.jpg"):
        found(["a/1.jpg", "b/1.jpg", "2.jpg"], table("1.jpg", "2.jpg", "3.jpg"))


def test_other_photographs_are_told_with_names_of_both_sides() -> None:
    photos = table(*(f"town_{i}.jpg" for i in range(20)))
    with pytest.raises(InputError) as told:
        found([f"lake_{i}.jpg" for i in range(30)], photos)
    assert "0 of their 30 names are among the 20 photographs" in told.value.problem
    assert "lake_0.jpg, lake_1.jpg" in told.value.problem and "town_0.jpg, town_1.jpg" in told.value.problem


def test_a_coincidence_of_a_few_names_is_not_enough() -> None:
    photos = table(*(f"{i}.jpg" for i in range(100)))
    with pytest.raises(InputError, match="4 of their 90"):
        found([f"{i}.jpg" for i in range(96, 186)], photos)


def test_the_camera_is_scaled_to_the_working_copy() -> None:
    photos = table("a.jpg", "b.jpg", "c.jpg", original=(4000, 3000), working=(1000, 747))
    one = match_photos(entries("a.jpg", "b.jpg", "c.jpg"), photos)[0]
    assert one.original == CAMERA
    assert (one.camera.model, one.camera.width, one.camera.height) == ("PINHOLE", 1000, 747)
    assert one.camera.params == pytest.approx((875.0, 871.5, 500.0, 373.5))


@pytest.mark.parametrize(
    ("size", "words"),
    [
        ((300, 400), "one of them is rotated"),
        ((400, 250), "the shapes differ"),
        ((404, 303), "undistorted copies"),
    ],
)
def test_a_photograph_that_the_pose_was_not_made_from(size: tuple[int, int], words: str) -> None:
    with pytest.raises(InputError) as told:
        found(["a.jpg", "b.jpg", "c.jpg"], table("a.jpg", "b.jpg", "c.jpg", original=size))
    assert "file, image 0" in told.value.problem and "a.jpg" in told.value.problem and words in told.value.problem


def test_folders_decide_between_raw_photographs_and_copies_of_the_same_numbers() -> None:
    raw = Camera("OPENCV", 400, 300, (350.0, 350.0, 200.0, 150.0, 0.1, 0.0, 0.0, 0.0))
    shifted = [
        Entry(((f"{i + 1:06d}.jpg", raw), (f"train/rgbs/{i:06d}", CAMERA)), np.eye(3, 4), f"{i}.pt", i)
        for i in range(5)
    ]
    copies = match_photos(shifted, table(*(f"train/rgbs/{i:06d}.jpg" for i in range(5))))
    assert {one.source_id: one.photo_id for one in copies} == {i: i for i in range(5)}
    assert {one.camera.model for one in copies} == {"PINHOLE"}


def test_the_first_name_that_is_there_brings_its_camera() -> None:
    raw = Camera("OPENCV", 400, 300, (350.0, 350.0, 200.0, 150.0, 0.1, 0.0, 0.0, 0.0))
    both = [
        Entry(((f"DJI_{i}.JPG", raw), (f"train/rgbs/00000{i}", CAMERA)), np.eye(3, 4), f"{i}.pt", i) for i in range(3)
    ]
    of_raw = match_photos(both, table(*(f"DJI_{i}.JPG" for i in range(3))))
    of_copies = match_photos(both, table(*(f"train/rgbs/00000{i}.jpg" for i in range(3))))
    assert {one.camera.model for one in of_raw} == {"OPENCV"}
    assert {one.camera.model for one in of_copies} == {"PINHOLE"}
