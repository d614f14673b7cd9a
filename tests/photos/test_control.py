"""Lists of ground control points are read as they are meant, and what is wrong in one is told with its line."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from aug3d_core.geometry.geodesy import enu_from_geodetic
from aug3d_core.photos.control import read_control
from aug3d_core.run.errors import InputError

# UTM 34N of 52.2 N, 21 E, the middle of the zone
EAST, NORTH = 500000.0, 5783299.0
UTM = "WGS84 UTM 34N"


def photos(lat_deg: float = 52.2, lon_deg: float = 21.0, count: int = 3) -> pd.DataFrame:
    """Return a photo table of photographs of 4000 x 3000 px, with working copies of 1000 x 750."""
    return pd.DataFrame(
        {
            "photo_id": range(count),
            "name": [f"flight/img_{i}.jpg" for i in range(count)],
            "original_width_px": 4000,
            "original_height_px": 3000,
            "width_px": 1000,
            "height_px": 750,
            "lat_deg": lat_deg,
            "lon_deg": lon_deg,
        }
    )


def listed(folder: Path, *lines: str, first: str = UTM) -> Path:
    file = folder / "gcp_list.txt"
    file.write_text("\n".join([first, *lines]) + "\n")
    return file


def mark(x: float = EAST, y: float = NORTH, height: float = 100.0, more: str = "400 300 img_0.jpg A") -> str:
    return f"{x} {y} {height} {more}"


def test_marks_are_read(tmp_path: Path) -> None:
    lines = [
        "# a comment",
        mark(),
        mark(more="800 600 flight/img_1.jpg A extra words"),
        "",
        f"{EAST + 30}\t{NORTH}\t101\t4000\t3000\timg_2.jpg\tCHK-1",
        mark(EAST, NORTH + 40, 99, "10 20 img_2.jpg"),
    ]
    table, notes = read_control(listed(tmp_path, *lines), photos())
    assert notes == ()
    assert table["point"].tolist() == ["A", "A", "CHK-1", f"500000 {NORTH + 40:.0f}"]
    assert table["check"].tolist() == [False, False, True, False]
    assert table["photo_id"].tolist() == [0, 1, 2, 2]
    assert table["line"].tolist() == [3, 4, 6, 7]
    np.testing.assert_allclose(table[["x_px", "y_px"]], [[100, 75], [200, 150], [1000, 750], [2.5, 5]])
    geodetic = table[["lat_deg", "lon_deg", "alt_m"]].to_numpy()
    enu = enu_from_geodetic(geodetic, geodetic[0])
    np.testing.assert_allclose(enu[[2, 3]], [[30, 0, 1], [0, 40, -1]], atol=0.04)  # the zone's scale is 0.9996
    assert abs(table["lat_deg"][0] - 52.2) < 1e-3 and table["lon_deg"][0] == pytest.approx(21)


@pytest.mark.parametrize(
    ("first", "x", "y"),
    [
        ("EPSG:32634", EAST, NORTH),
        ("+proj=utm +zone=34 +datum=WGS84 +units=m +no_defs", EAST, NORTH),
        ("wgs84 utm 34 n", EAST, NORTH),
        ("EPSG:4326", 21.0, 52.2),
    ],
)
def test_projections(tmp_path: Path, first: str, x: float, y: float) -> None:
    table, _ = read_control(listed(tmp_path, mark(x, y), first=first), photos())
    assert abs(table["lat_deg"][0] - 52.2) < 1e-3 and table["lon_deg"][0] == pytest.approx(21)


def test_what_is_not_used_is_told(tmp_path: Path) -> None:
    lines = [mark(), mark(height=np.nan, more="1 1 img_1.jpg B"), mark(more="1 1 lost.jpg A")]
    table, notes = read_control(listed(tmp_path, *lines), photos())
    assert table["point"].tolist() == ["A"]
    assert any("lost.jpg" in note for note in notes) and any(
        "1 points of gcp_list.txt have no height" in note for note in notes
    )


@pytest.mark.parametrize("gps", [True, False])
def test_a_list_without_any_height_in_these_photographs_is_refused(tmp_path: Path, gps: bool) -> None:
    lines = [mark(height=np.nan), mark(height=np.nan, more="1 1 img_1.jpg A"), mark(more="1 1 lost.jpg B")]
    table = photos() if gps else photos(np.nan, np.nan)
    with pytest.raises(InputError, match=r"gcp_list.txt: no point that these photographs show has a height") as error:
        read_control(listed(tmp_path, *lines), table)
    assert "third column" in error.value.remedy


@pytest.mark.parametrize(
    ("lines", "told"),
    [
        ((mark(NORTH, EAST),), r"line 2: the point lies .* the GPS of the photographs"),
        ((mark(), mark(NORTH, EAST, more="1 1 img_0.jpg B")), r"line 3: the point lies"),
        ((mark(more="400 300"),), r"line 2: 5 columns, where 6 or 7"),
        ((f"img_0.jpg {EAST} {NORTH} 100 400 300",), r"line 2: column 1, 'img_0.jpg', is no number"),
        ((mark(more="400,5 300 img_0.jpg"),), r"line 2: column 4, '400,5', is no number"),
        ((mark(x=float("inf")),), r"line 2: column 1, 'inf', is no number that can be used"),
        (
            (mark(more="4001 300 img_0.jpg"),),
            r"line 2: pixel \(4001, 300\) is outside img_0.jpg, which has 4000 x 3000 px",
        ),
        ((mark(), mark(x=EAST + 1, more="1 1 img_1.jpg A")), r"line 3: 'A' is not where line 2 has it"),
        ((mark(), mark()), r"line 3: 'A' is marked in img_0.jpg already, by line 2"),
        ((mark(more="1 1 flight/img_0.jpg A"), mark()), r"line 3: 'A' is marked in img_0.jpg already, by line 2"),
        ((mark(height=np.nan), mark(x=EAST + 1, more="1 1 img_1.jpg A")), r"line 3: 'A' is not where line 2 has it"),
        (
            (mark(height=np.nan), mark(more="1 1 img_1.jpg A"), mark(height=101, more="1 1 img_2.jpg A")),
            r"line 4: 'A' is not where line 3 has it",
        ),
        ((mark(more="400 300 other.jpg A"),), r"names none of the photographs: line 2 has 'other.jpg'"),
        ((), "has no point"),
    ],
)
def test_what_is_wrong_is_told_with_its_line(tmp_path: Path, lines: tuple[str, ...], told: str) -> None:
    with pytest.raises(InputError, match=told) as error:
        read_control(listed(tmp_path, *lines), photos())
    assert "gcp_list.txt" in error.value.problem and error.value.remedy


def test_a_name_in_several_folders_needs_its_folder(tmp_path: Path) -> None:
    table = photos()
    table["name"] = ["a/img_0.jpg", "b/img_0.jpg", "b/img_1.jpg"]
    with pytest.raises(
        InputError, match=r"line 3: img_0.jpg is the name of several photographs: a/img_0.jpg, b/img_0.jpg"
    ) as told:
        read_control(listed(tmp_path, mark(more="1 1 img_1.jpg A"), mark()), table)
    assert "Write its folder too" in told.value.remedy
    marks, _ = read_control(listed(tmp_path, mark(more="1 1 img_1.jpg A"), mark(more="1 1 b/img_0.jpg A")), table)
    assert marks["photo_id"].tolist() == [2, 1]
    table["name"] = ["a/img_0.jpg", "img_0.jpg", "b/img_1.jpg"]  # in the folder itself: that is its whole name
    assert read_control(listed(tmp_path, mark()), table)[0]["photo_id"].tolist() == [1]


FOOT_M = 1200 / 3937  # of the US survey


@pytest.mark.parametrize(
    ("first", "foot_m", "height_m"),
    [
        (UTM, 1, 100.0),
        ("+proj=utm +zone=34 +datum=WGS84 +units=us-ft", FOOT_M, 100 * FOOT_M),
        ("+proj=utm +zone=34 +datum=WGS84 +units=ft", 0.3048, 30.48),
        ("+proj=utm +zone=34 +datum=WGS84 +units=us-ft +vunits=m", FOOT_M, 100.0),
        ("+proj=utm +zone=34 +datum=WGS84 +units=m +vunits=us-ft", 1, 100 * FOOT_M),
    ],
)
def test_heights_become_metres(tmp_path: Path, first: str, foot_m: float, height_m: float) -> None:
    table, notes = read_control(listed(tmp_path, mark(EAST / foot_m, NORTH / foot_m), first=first), photos())
    assert table["alt_m"][0] == pytest.approx(height_m) and abs(table["lat_deg"][0] - 52.2) < 1e-3
    assert any("become metres" in note for note in notes) == (height_m != 100)


@pytest.mark.parametrize(
    ("first", "height_m"), [("EPSG:2263", 100 * FOOT_M), ("EPSG:2263+5703", 100.0), ("EPSG:2263+6360", 100 * FOOT_M)]
)
def test_heights_over_a_plane_in_feet(tmp_path: Path, first: str, height_m: float) -> None:
    table, _ = read_control(listed(tmp_path, mark(984250.0, 0.0), first=first), photos(40.17, -74.0))
    assert table["alt_m"][0] == pytest.approx(height_m)


@pytest.mark.parametrize(
    ("first", "x", "y", "remedy"),
    [
        (UTM, NORTH, EAST, "x and y look exchanged"),
        ("WGS84 UTM 33N", EAST, NORTH, "the zone looks wrong: in WGS84 UTM 34N it lies among them"),
        ("WGS84 UTM 34S", EAST, NORTH, "the zone looks wrong: in WGS84 UTM 34N it"),
        ("WGS84 UTM 35N", NORTH, EAST, "in WGS84 UTM 34N, with x and y exchanged it"),
        ("EPSG:4326", 52.2, 21.0, "x and y look exchanged"),
        ("EPSG:4326", EAST, NORTH, "the zone looks wrong: in WGS84 UTM 34N it lies among them"),
        (UTM, 34_000_000 + EAST, NORTH, "x begins with the zone: as 500000 in WGS84 UTM 34N it lies among them"),
        (UTM, EAST * 100, NORTH, "Each line is"),
        (UTM, EAST * 1000, NORTH * 1000, "Each line is"),
        ('LOCAL_CS["site",UNIT["m",1]]', EAST, NORTH, "in WGS84 UTM 34N it lies among them"),
        (UTM, EAST + 100_000, NORTH, "Each line is"),
    ],
)
def test_a_point_elsewhere_is_told_with_what_would_bring_it_here(
    tmp_path: Path, first: str, x: float, y: float, remedy: str
) -> None:
    with pytest.raises(InputError, match="line 2: the point lies") as error:
        read_control(listed(tmp_path, mark(x, y), first=first), photos())
    assert remedy in error.value.remedy


def test_without_gps_points_are_held_against_each_other(tmp_path: Path) -> None:
    lines = [mark(), mark(EAST + 9, more="1 1 img_0.jpg B"), mark(EAST + 90_000, more="1 1 img_0.jpg C")]
    with pytest.raises(InputError, match="line 4: the point lies 90 km from the other points"):
        read_control(listed(tmp_path, *lines), photos(np.nan, np.nan))
    table, _ = read_control(listed(tmp_path, *lines[:2]), photos(np.nan, np.nan))
    assert len(table) == 2


@pytest.mark.parametrize("gps", [True, False])
def test_a_point_that_its_projection_does_not_have_is_told_with_its_own_line(tmp_path: Path, gps: bool) -> None:
    lines = [mark(), mark(EAST + 9, more="1 1 img_0.jpg B"), mark(EAST * 1e4, more="1 1 img_0.jpg C")]
    with pytest.raises(InputError, match="line 4: the point lies outside of its projection"):
        read_control(listed(tmp_path, *lines), photos() if gps else photos(np.nan, np.nan))


def test_a_projection_that_has_none_of_the_points_is_told(tmp_path: Path) -> None:
    file = listed(tmp_path, mark(), first='LOCAL_CS["site",UNIT["m",1]]')
    with pytest.raises(InputError, match="line 2: the point lies outside of its projection"):
        read_control(file, photos(np.nan, np.nan))


@pytest.mark.parametrize(
    ("content", "told"), [(b"", "is empty"), (b"\xff\xfe\x00", "cannot be read"), (b"Mars 7\n1 2\n", "line 2")]
)
def test_a_file_that_is_none(tmp_path: Path, content: bytes, told: str) -> None:
    (tmp_path / "gcp_list.txt").write_bytes(content)
    with pytest.raises(InputError, match=told):
        read_control(tmp_path / "gcp_list.txt", photos())


@pytest.mark.parametrize("first", ["Mars 7", "WGS84 UTM 0N", "WGS84 UTM 61N"])
def test_a_projection_that_is_none(tmp_path: Path, first: str) -> None:
    with pytest.raises(InputError, match=f"line 1: '{first}' is no projection"):
        read_control(listed(tmp_path, mark(), first=first), photos())
