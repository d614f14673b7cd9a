"""A folder becomes a table in capture order; folders that cannot be used say why."""

from __future__ import annotations

import os
import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from PIL import ExifTags, Image
from PIL.TiffImagePlugin import IFDRational

from aug3d_core.photos.config import PhotosConfig
from aug3d_core.photos.files import read_photos
from aug3d_core.photos.stage import run
from aug3d_core.run.errors import InputError
from aug3d_core.run.stage import Outcome
from tests.photos.photo_files import degrees, write_photo
from tests.same_files import assert_same_files

TAG = ExifTags.Base
GPS = ExifTags.GPS


def take_in(folder: Path, out: Path, min_photos: int = 3, **config: int) -> Outcome:
    out.mkdir(exist_ok=True)
    return run({"folder": folder}, PhotosConfig(min_photos=min_photos, **config), out, lambda done, total, what: None)


def rejected(out: Path) -> dict[str, str]:
    table = pd.read_parquet(out / "rejected.parquet")
    return dict(zip(table["name"], table["reason"], strict=True))


def at(time: str) -> dict[int, Any]:
    return {TAG.DateTimeOriginal: f"2020:01:01 {time}"}


def test_capture_order_is_time_then_name(tmp_path: Path) -> None:
    write_photo(tmp_path / "in" / "c.jpg", 0, detail=at("10:00:00"))
    write_photo(tmp_path / "in" / "sub" / "b.jpg", 1, detail=at("10:00:01"))
    write_photo(tmp_path / "in" / "img_10.jpg", 2, detail=at("10:00:02"))
    write_photo(tmp_path / "in" / "img_9.jpg", 3, detail=at("10:00:02"))
    outcome = take_in(tmp_path / "in", tmp_path / "out")
    photos = read_photos(tmp_path / "out")
    assert photos["name"].tolist() == ["c.jpg", "sub/b.jpg", "img_9.jpg", "img_10.jpg"]
    assert photos["photo_id"].tolist() == [0, 1, 2, 3]
    assert outcome.state == "ok"
    assert (tmp_path / "out" / "contact_sheet.jpg").exists()


def test_one_photograph_without_time_leaves_the_order_to_names(tmp_path: Path) -> None:
    write_photo(tmp_path / "in" / "a.jpg", 0, detail=at("12:00:00"))
    write_photo(tmp_path / "in" / "b.jpg", 1)
    write_photo(tmp_path / "in" / "c.jpg", 2, detail=at("10:00:00"))
    outcome = take_in(tmp_path / "in", tmp_path / "out")
    assert read_photos(tmp_path / "out")["name"].tolist() == ["a.jpg", "b.jpg", "c.jpg"]
    assert "1 photographs have no time" in outcome.notes[0]


def test_the_table_matches_the_working_copies(tmp_path: Path) -> None:
    position = {
        GPS.GPSLatitudeRef: "N",
        GPS.GPSLongitudeRef: "E",
        GPS.GPSLatitude: degrees(52),
        GPS.GPSLongitude: degrees(21),
    }
    for i in range(3):
        detail = at(f"10:00:0{i}") | {TAG.FocalLengthIn35mmFilm: 35}
        write_photo(tmp_path / "in" / f"{i}.jpg", i, (640, 480), detail, position if i else None)
    outcome = take_in(tmp_path / "in", tmp_path / "out", max_px=320)
    photos = read_photos(tmp_path / "out")
    for photo in photos.itertuples():
        with Image.open(tmp_path / "out" / str(photo.file)) as copy:
            assert copy.size == (photo.width_px, photo.height_px) == (320, 240)
    assert photos["original_width_px"].tolist() == [640] * 3
    np.testing.assert_allclose(photos["focal_px"], 35 / 43.2666 * 400, rtol=1e-5)  # at the size of the copies
    assert photos["lat_deg"].isna().tolist() == [True, False, False]
    assert str(photos["time"].dtype) == "datetime64[ms]"
    assert outcome.metrics["with_gps"] == 2
    assert outcome.metrics["with_focal"] == 3
    assert outcome.metrics["cameras"] == 1


def cameras_of(folder: Path, out: Path, *focal_35mm: float | None) -> list[str]:
    for i, equivalent_mm in enumerate(focal_35mm):
        mm = (
            {}
            if equivalent_mm is None
            else {
                TAG.FocalPlaneXResolution: IFDRational(round(1000 * equivalent_mm), 100),
                TAG.FocalPlaneResolutionUnit: 4,
            }
        )
        write_photo(folder / f"{i}.jpg", i, detail={TAG.FocalLength: IFDRational(5)} | mm)
    outcome = take_in(folder, out)
    cameras = read_photos(out)["camera"].tolist()
    assert outcome.metrics["cameras"] == len(set(cameras))
    return cameras


def test_digital_zoom_makes_another_camera(tmp_path: Path) -> None:
    """The lens and its millimetres stay, and the focal length in pixels does not."""
    cameras = cameras_of(tmp_path / "in", tmp_path / "out", 6, 12, 6, 12.05, None)
    assert cameras[0] == cameras[2] != cameras[1] == cameras[3], "zoomed in, a lens wavers as it does at rest"
    assert cameras[4] not in cameras[:4], "which of them took it is not known"


def test_a_focal_length_that_wavers_is_that_of_one_camera(tmp_path: Path) -> None:
    assert cameras_of(tmp_path / "in", tmp_path / "out", 6, 6.05, 6.1, None) == ["unknown 320x240 5mm"] * 4


def test_bad_photographs_are_listed_and_left_out(tmp_path: Path) -> None:
    folder = tmp_path / "in"
    for i in range(4):
        write_photo(folder / f"{i}.png", i)
    shutil.copy(folder / "1.png", folder / "copy of 1.png")
    Image.open(folder / "2.png").save(folder / "two.tif")
    write_photo(folder / "cut.jpg", 9)
    (folder / "cut.jpg").write_bytes((folder / "cut.jpg").read_bytes()[:-900])
    write_photo(folder / "thumb.jpg", 8, (100, 75))
    (folder / "readme.txt").write_text("hello")
    outcome = take_in(folder, tmp_path / "out")
    reasons = rejected(tmp_path / "out")
    assert reasons["copy of 1.png"] == "duplicate: same bytes as 1.png"
    assert reasons["two.tif"] == "duplicate: same pixels as 2.png"
    assert reasons["cut.jpg"].startswith("unreadable: image file is truncated")
    assert reasons["thumb.jpg"].startswith("tiny: 100x75 px")
    assert (outcome.metrics["photos"], outcome.metrics["rejected"], outcome.metrics["ignored_files"]) == (4, 4, 1)
    assert outcome.state == "ok"
    assert sorted(path.name for path in (tmp_path / "out" / "images").iterdir()) == [f"{i:06d}.png" for i in range(4)]


def test_an_orthophoto_beside_the_photographs_is_left_out_and_does_not_disturb_their_order(tmp_path: Path) -> None:
    for name, time in (("b.jpg", "10:00:00"), ("a.jpg", "10:00:01"), ("c.jpg", "10:00:02")):
        write_photo(tmp_path / "in" / "images" / name, ord(name[0]), detail=at(time))
    write_photo(tmp_path / "in" / "reference" / "orthophoto.jpg", 9, (500, 300))
    outcome = take_in(tmp_path / "in", tmp_path / "out")
    assert read_photos(tmp_path / "out")["name"].tolist() == ["images/b.jpg", "images/a.jpg", "images/c.jpg"]
    assert rejected(tmp_path / "out")["reference/orthophoto.jpg"].startswith("no photograph: ")
    assert len(list((tmp_path / "out" / "images").iterdir())) == outcome.metrics["photos"] == 3


def test_a_name_that_is_not_utf_8_is_left_out_and_shown(tmp_path: Path) -> None:
    for i in range(3):
        write_photo(tmp_path / "in" / f"m\u00fcggelsee {i}.png", i)
    write_photo(tmp_path / "in" / os.fsdecode(b"m\xe9vres.png"), 3)
    outcome = take_in(tmp_path / "in", tmp_path / "out")
    assert (outcome.metrics["photos"], outcome.metrics["rejected"]) == (3, 1)
    assert rejected(tmp_path / "out") == {"m\\xe9vres.png": "name: not UTF-8; rename the file"}


def test_more_bad_than_good_is_degraded(tmp_path: Path) -> None:
    for i in range(3):
        write_photo(tmp_path / "in" / f"{i}.png", i)
    for i in range(4):
        (tmp_path / "in" / f"bad{i}.jpg").write_text("no photograph")
    assert take_in(tmp_path / "in", tmp_path / "out").state == "degraded"


def test_the_same_folder_gives_the_same_bytes(tmp_path: Path) -> None:
    for i in range(3):
        write_photo(tmp_path / "in" / f"{i}.jpg", i, detail=at("10:00:00"))
    take_in(tmp_path / "in", tmp_path / "one")
    take_in(tmp_path / "in", tmp_path / "two")
    assert_same_files(tmp_path / "one", tmp_path / "two")


def test_an_empty_folder(tmp_path: Path) -> None:
    (tmp_path / "in").mkdir()
    with pytest.raises(InputError, match="in is empty"):
        take_in(tmp_path / "in", tmp_path / "out")


def test_a_folder_of_text_files(tmp_path: Path) -> None:
    (tmp_path / "in").mkdir()
    for i in range(3):
        (tmp_path / "in" / f"{i}.txt").write_text("hello")
    with pytest.raises(InputError, match="in holds 3 files, none of them a photograph"):
        take_in(tmp_path / "in", tmp_path / "out")


def test_three_photographs_are_refused_here_already(tmp_path: Path) -> None:
    """The split needs four: two to train on, two for the test."""
    for i in range(3):
        write_photo(tmp_path / "in" / f"{i}.jpg", i)
    with pytest.raises(InputError, match="in holds 3 usable photographs of 3; at least 4 are needed"):
        take_in(tmp_path / "in", tmp_path / "out", PhotosConfig().min_photos)


def test_three_photographs_one_of_them_broken(tmp_path: Path) -> None:
    for i in range(2):
        write_photo(tmp_path / "in" / f"{i}.jpg", i)
    (tmp_path / "in" / "cut.jpg").write_bytes((tmp_path / "in" / "0.jpg").read_bytes()[:-700])
    with pytest.raises(
        InputError, match=r"2 usable photographs of 3.*\n +cut\.jpg: unreadable: image file is truncated"
    ):
        take_in(tmp_path / "in", tmp_path / "out")
