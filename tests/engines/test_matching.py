"""The matching stage: the same bytes however it came about, only new work for new photographs, a camera for each camera."""

from __future__ import annotations

import os
import shutil
import sqlite3
from collections.abc import Callable, Iterable
from contextlib import closing, suppress
from filecmp import cmp
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pycolmap
import pytest
from PIL import Image

from aug3d_core.bench.scale import recall_unordered
from aug3d_core.photos.files import image_name
from aug3d_core.run.files import EARLIER
from aug3d_core.sfm.features import SHARDS
from aug3d_core.sfm.files import FEATURES, MATCHING_TABLE
from aug3d_core.sfm.matching_stage import UNSORTED
from tests.engines.little_scene import FOCAL_PX
from tests.engines.sfm_runs import outcome_of, run_stage, run_stage_killed, take_photos

pytestmark = pytest.mark.slow


def run_matching(
    photos: Path, folder: Path, earlier: list[Path] | None = None, cpus: set[int] | None = None, **config: Any
) -> dict[str, Any]:
    """Run the stage with earlier outputs, newest first; return its outcome."""
    inputs = {"photos": photos}
    if earlier is not None:
        inputs[EARLIER] = folder.with_name(f"{folder.name}_earlier")
        inputs[EARLIER].mkdir()
        for age, files in enumerate(earlier):
            (inputs[EARLIER] / f"{age:02d}").symlink_to(files)
    return run_stage("matching", folder, inputs, cpus, **config)


def files_of(folder: Path) -> Path:
    return folder / "files"


def assert_same_files(first: Path, second: Path) -> None:
    names = sorted(path.name for path in first.iterdir())
    assert names == sorted(path.name for path in second.iterdir()) == [FEATURES, MATCHING_TABLE]
    assert differing_rows(first / FEATURES, second / FEATURES) == []
    for name in names:
        assert cmp(first / name, second / name, shallow=False), name


def differing_rows(first: Path, second: Path) -> list[tuple[str, Any]]:
    """Return the table and the key of each row that only one of the databases holds."""
    with closing(sqlite3.connect(first)) as connection:
        connection.execute("ATTACH ? AS other", (str(second),))
        tables = [name for (name,) in connection.execute("SELECT name FROM main.sqlite_master WHERE type = 'table'")]
        one_sided = "SELECT * FROM (SELECT * FROM {0}.{2} EXCEPT SELECT * FROM {1}.{2})"
        found = {
            (table, row[0])
            for table in tables
            for sides in (("main", "other"), ("other", "main"))
            for row in connection.execute(one_sided.format(*sides, table))
        }
    return sorted(found, key=str)


def min_scale_px(files: Path, scratch: Path) -> float:
    """Return the scale of the smallest feature, in pixels."""
    copied = shutil.copy(files / FEATURES, scratch)  # to open it is to write to it
    with pycolmap.Database.open(copied) as database:
        shapes = np.concatenate([database.read_keypoints(image.image_id) for image in database.read_all_images()])[
            :, 2:
        ]
    return float(np.sqrt(np.abs(shapes[:, 0] * shapes[:, 3] - shapes[:, 1] * shapes[:, 2])).min())


def copy_some(flown: Path, folder: Path, which: Iterable[int]) -> Path:
    """Copy some photographs of the flight, as a user who has not taken the others yet."""
    folder.mkdir()
    for i in which:
        shutil.copy(flown / "in" / f"photo_{i}.jpg", folder)
    return folder


@pytest.fixture
def flown(little_flight: Path) -> tuple[Path, dict[str, Any]]:
    """Return a folder with `in`, `photos` and `sfm_matching`, the finished stage over 12 photographs, and its outcome."""
    return little_flight, outcome_of(little_flight / "sfm_matching")


def test_metrics_and_table_agree(flown: tuple[Path, dict[str, Any]]) -> None:
    folder, outcome = flown
    metrics, table = outcome["metrics"], pd.read_parquet(files_of(folder / "sfm_matching") / MATCHING_TABLE)
    assert (metrics["photos"], metrics["pairs_possible"], metrics["pairs_tried"]) == (12, 66, 66)
    assert metrics["pairs_by"] == "exhaustive"
    assert table["matched_pairs"].sum() == 2 * metrics["pairs_matched"] > 40
    assert (table["tried_pairs"] == 11).all()
    assert table["features"].median() == metrics["features_median"] > 1000
    assert table["photo_id"].tolist() == list(range(12))
    assert (metrics["photos_reused"], metrics["pairs_reused"]) == (0, 0)


def test_recall_of_pairs_is_measured_without_a_trace_in_the_store(flown: tuple[Path, dict[str, Any]]) -> None:
    """`aug3d bench scale` once changed the database that it read, which the store then took for damaged."""
    folder, _ = flown
    matching = files_of(folder / "sfm_matching")
    before = {file.name: file.read_bytes() for file in matching.iterdir()}
    found = recall_unordered(folder / "photos", matching, files_of(folder / "sfm"))
    assert found["pairs_recall_unordered"].value == 1.0
    assert {file.name: file.read_bytes() for file in matching.iterdir()} == before


def test_photographs_as_they_are_show_no_feature_smaller_than_their_pixels(
    flown: tuple[Path, dict[str, Any]], tmp_path: Path
) -> None:
    run_matching(flown[0] / "photos", tmp_path / "as_they_are", first_octave=0)
    doubled_px, as_they_are_px = (
        min_scale_px(files_of(made), tmp_path) for made in (flown[0] / "sfm_matching", tmp_path / "as_they_are")
    )
    assert doubled_px < 1 < 1.6 <= as_they_are_px


def test_any_number_of_threads_gives_the_same_bytes(flown: tuple[Path, dict[str, Any]], tmp_path: Path) -> None:
    run_matching(flown[0] / "photos", tmp_path / "one", cpus={min(os.sched_getaffinity(0))})
    assert_same_files(files_of(flown[0] / "sfm_matching"), files_of(tmp_path / "one"))


def test_added_photographs_are_all_that_is_new(flown: tuple[Path, dict[str, Any]], tmp_path: Path) -> None:
    fewer = take_photos(copy_some(flown[0], tmp_path / "in", [0, 1, 2, 4, 5, 6, 7, 9, 10, 11]), tmp_path / "photos")
    run_matching(fewer, tmp_path / "fewer")
    few = take_photos(copy_some(flown[0], tmp_path / "in_few", [0, 1, 2, 4]), tmp_path / "few_photos")
    run_matching(few, tmp_path / "few")
    earlier = [files_of(tmp_path / "few"), files_of(tmp_path / "fewer")]
    as_stored = [(files / FEATURES).read_bytes() for files in earlier]
    grown = run_matching(flown[0] / "photos", tmp_path / "grown", earlier)["metrics"]
    assert (grown["photos_reused"], grown["pairs_reused"], grown["pairs_tried"]) == (10, 45, 66)
    assert_same_files(files_of(flown[0] / "sfm_matching"), files_of(tmp_path / "grown"))
    assert [(files / FEATURES).read_bytes() for files in earlier] == as_stored


def holding(rows: int, table: str, scratch: Path) -> Callable[[Path], bool]:
    """Return whether a stage's database holds so many rows. A copy is read: COLMAP does not wait for a reader."""

    def moment(files: Path) -> bool:
        try:
            for end in ("", "-wal"):
                with suppress(FileNotFoundError):
                    shutil.copy(files / UNSORTED / f"{FEATURES}{end}", scratch)
            with closing(sqlite3.connect(scratch / FEATURES)) as copied:
                return copied.execute(f"SELECT COUNT(*) FROM {table}").fetchone()[0] >= rows
        except sqlite3.DatabaseError:  # not there yet, or written while it was copied
            return False

    scratch.mkdir(exist_ok=True)
    return moment


def test_killed_at_many_moments_it_goes_on_and_ends_in_the_same_bytes(
    flown: tuple[Path, dict[str, Any]], tmp_path: Path
) -> None:
    """A power cut may tear the database: then all is searched again."""
    found: list[int] = []

    def torn(files: Path) -> bool:
        database = files / UNSORTED / FEATURES
        found.append(database.stat().st_size)
        os.truncate(database, 9000)
        return True

    some = holding(3, "descriptors", tmp_path / "copy")
    moments = [some, torn, some, holding(12, "descriptors", tmp_path / "copy")]
    moments.append(lambda files: any((files / UNSORTED / SHARDS).glob("pairs_*.db")))
    outcome = run_stage_killed("matching", tmp_path / "killed", {"photos": flown[0] / "photos"}, moments)
    assert found[0] > 9000
    assert_same_files(files_of(flown[0] / "sfm_matching"), files_of(tmp_path / "killed"))
    whole = {name: value for name, value in flown[1]["metrics"].items() if not name.endswith("_seconds")}
    assert outcome["metrics"] == whole


def test_what_was_copied_before_a_kill_is_not_copied_twice(flown: tuple[Path, dict[str, Any]], tmp_path: Path) -> None:
    fewer = take_photos(copy_some(flown[0], tmp_path / "in", [0, 1, 2, 4, 5, 6, 7, 9, 10, 11]), tmp_path / "photos")
    run_matching(fewer, tmp_path / "fewer")
    (tmp_path / "earlier").mkdir()
    (tmp_path / "earlier" / "00").symlink_to(files_of(tmp_path / "fewer"))
    inputs = {"photos": flown[0] / "photos", EARLIER: tmp_path / "earlier"}
    moments = [holding(10, "descriptors", tmp_path / "copy"), holding(45, "two_view_geometries", tmp_path / "copy")]
    outcome = run_stage_killed("matching", tmp_path / "grown", inputs, moments)["metrics"]
    assert (outcome["photos_reused"], outcome["pairs_reused"], outcome["pairs_tried"]) == (10, 45, 66)
    assert_same_files(files_of(flown[0] / "sfm_matching"), files_of(tmp_path / "grown"))


def test_what_another_machine_has_found_is_used_and_the_bytes_are_the_same(
    flown: tuple[Path, dict[str, Any]], tmp_path: Path
) -> None:
    """A shard that a power cut tore is made again."""
    inputs, mine = {"photos": flown[0] / "photos"}, tmp_path / "mine"
    run_stage("matching", tmp_path / "theirs", inputs, assist=True)
    shards = files_of(mine) / UNSORTED / SHARDS
    shutil.copytree(files_of(tmp_path / "theirs") / UNSORTED / SHARDS, shards)
    assert [file.name.partition("_")[0] for file in sorted(shards.iterdir())] == ["features"] * 2 + ["pairs"] * 3
    whole = {file: file.read_bytes() for file in shards.iterdir()}
    torn, *others = sorted(shards.iterdir())
    os.truncate(torn, 9000)
    as_copied = {file: (file.stat().st_ino, file.stat().st_mtime_ns) for file in others}
    run_stage("matching", mine, inputs, assist=True)
    assert {file: (file.stat().st_ino, file.stat().st_mtime_ns) for file in others} == as_copied
    assert {file: file.read_bytes() for file in shards.iterdir()} == whole
    run_stage("matching", mine, inputs)
    assert_same_files(files_of(flown[0] / "sfm_matching"), files_of(mine))


def test_removed_photographs_leave_nothing(flown: tuple[Path, dict[str, Any]], tmp_path: Path) -> None:
    fewer = take_photos(copy_some(flown[0], tmp_path / "in", [0, 1, 2, 4, 5]), tmp_path / "photos")
    run_matching(fewer, tmp_path / "anew")
    shrunk = run_matching(fewer, tmp_path / "shrunk", [files_of(flown[0] / "sfm_matching")])["metrics"]
    assert (shrunk["photos_reused"], shrunk["pairs_reused"]) == (5, 10)
    assert_same_files(files_of(tmp_path / "anew"), files_of(tmp_path / "shrunk"))


def test_another_order_and_another_lens_are_verified_again(flown: tuple[Path, dict[str, Any]], tmp_path: Path) -> None:
    """A photograph without a time, nor focal length, puts all in the order of their names: the opposite of before."""
    copy_some(flown[0], tmp_path / "in", range(8))
    for i in range(8):
        (tmp_path / "in" / f"photo_{i}.jpg").rename(tmp_path / "in" / f"p{20 - i}.jpg")
    with Image.open(tmp_path / "in" / "p15.jpg") as image:
        image.load()
    image.info.pop("exif")
    image.save(tmp_path / "in" / "p15.jpg", quality=95)
    photos = take_photos(tmp_path / "in", tmp_path / "photos")
    run_matching(photos, tmp_path / "anew")
    grown = run_matching(photos, tmp_path / "grown", [files_of(flown[0] / "sfm_matching")])["metrics"]
    assert grown["photos_reused"] >= 7
    assert grown["pairs_reused"] == 0
    assert_same_files(files_of(tmp_path / "anew"), files_of(tmp_path / "grown"))


def test_each_camera_is_a_camera(flown: tuple[Path, dict[str, Any]], tmp_path: Path) -> None:
    """Two with known focal lengths, by turns, a third of another size, and a fourth without EXIF."""
    copy_some(flown[0], tmp_path / "in", range(6))
    for i, change in ((1, "focal"), (3, "focal"), (4, "size"), (5, "bare")):
        file = tmp_path / "in" / f"photo_{i}.jpg"
        with Image.open(file) as image:
            image.load()
        exif = image.getexif()
        if change == "focal":
            exif.get_ifd(0x8769).update({0x920A: 8.0, 0xA405: 60})  # FocalLength, FocalLengthIn35mmFilm
        if change == "size":
            image = image.crop((0, 0, 320, 200))
        image.save(file, quality=95, exif=Image.Exif() if change == "bare" else exif)
    photos = take_photos(tmp_path / "in", tmp_path / "photos")
    run_matching(photos, tmp_path / "out")
    with pycolmap.Database.open(files_of(tmp_path / "out") / FEATURES) as database:
        cameras = {camera.camera_id: camera for camera in database.read_all_cameras()}
        camera_of = {image.name: cameras[image.camera_id] for image in database.read_all_images()}
    by_photo = [camera_of[image_name(i)] for i in range(6)]
    assert [camera.camera_id for camera in by_photo[:5]] == [by_photo[0].camera_id, by_photo[1].camera_id] * 2 + [
        by_photo[4].camera_id
    ]
    assert len(cameras) == len({camera.camera_id for camera in by_photo}) == 4
    assert [camera.has_prior_focal_length for camera in by_photo] == [True] * 5 + [False]
    np.testing.assert_allclose([camera.focal_length for camera in by_photo[:2]], [FOCAL_PX, 2 * FOCAL_PX], rtol=1e-6)
    assert (by_photo[4].width, by_photo[4].height) == (320, 200)


def test_pairs_are_those_that_look_alike(flown: tuple[Path, dict[str, Any]], tmp_path: Path) -> None:
    metrics = run_matching(flown[0] / "photos", tmp_path / "out", pairs="coarse", neighbours=3)["metrics"]
    assert metrics["pairs_by"] == "coarse"
    assert metrics["pairs_ranked"] == 66 > metrics["pairs_tried"]
    table = pd.read_parquet(files_of(tmp_path / "out") / MATCHING_TABLE)
    assert table["matched_pairs"].min() >= 3


def test_photographs_without_texture_are_named(flown: tuple[Path, dict[str, Any]], tmp_path: Path) -> None:
    copy_some(flown[0], tmp_path / "in", range(3))
    Image.new("RGB", (320, 240), (90, 120, 80)).save(tmp_path / "in" / "meadow.png")
    outcome = run_matching(take_photos(tmp_path / "in", tmp_path / "photos"), tmp_path / "out")
    assert outcome["metrics"]["features_min"] == 0
    assert outcome["notes"] == ["1 of 4 photographs have fewer than 100 features (no texture, or blurred): meadow.png"]
