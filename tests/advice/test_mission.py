"""Files for the field hold what DJI's published format asks for, and the places that were meant."""

from __future__ import annotations

import csv
import io
import json
import zipfile
from xml.etree import ElementTree

import numpy as np
import pytest

from aug3d_core.advice.choice import Advised
from aug3d_core.advice.mission import MOST_POINTS, Waypoint, geojson, kml, listing, missions, waypoints
from aug3d_core.geometry.geodesy import enu_from_geodetic

ORIGIN = np.array([46.9, 7.5, 540.0])
LOWEST_M = -4.0
W, K = "{http://www.dji.com/wpmz/1.0.2}", "{http://www.opengis.net/kml/2.2}"
# Of the tables "Is it required" of DJI's documentation, for a waypoint route
MISSION = (
    "flyToWaylineMode", "finishAction", "exitOnRCLost", "executeRCLostAction", "takeOffSecurityHeight",
    "globalTransitionalSpeed", "globalRTHHeight", "droneInfo", "payloadInfo",
)  # fmt: skip
WAYLINE = ("templateId", "waylineId", "autoFlightSpeed", "executeHeightMode")
WAYPOINT = ("index", "executeHeight", "waypointSpeed", "waypointHeadingParam", "waypointTurnParam", "actionGroup")
TEMPLATE = ("templateType", "templateId", "autoFlightSpeed", "waylineCoordinateSysParam", "gimbalPitchMode", "globalHeight",
            "globalWaypointHeadingParam", "globalWaypointTurnMode")  # fmt: skip
TEMPLATE_POINT = ("index", "ellipsoidHeight", "height", "useGlobalHeight", "useGlobalSpeed", "useGlobalHeadingParam",
                  "useGlobalTurnParam", "gimbalPitchAngle")  # fmt: skip


def advised(count: int) -> list[Advised]:
    rng = np.random.default_rng(0)
    return [
        Advised(i + 1, (*map(float, rng.uniform(-80, 80, 2)), float(rng.uniform(50, 70))), float(rng.integers(4) * 90.0),
                -55.0, 0.01, 0.5, 0.1, 1.0)
        for i in range(count)
    ]  # fmt: skip


def points(count: int) -> list[Waypoint]:
    return waypoints(advised(count), ORIGIN, LOWEST_M)


def opened(content: bytes) -> tuple[ElementTree.Element, ElementTree.Element]:
    with zipfile.ZipFile(io.BytesIO(content)) as kmz:
        assert kmz.namelist() == ["wpmz/template.kml", "wpmz/waylines.wpml"]
        return tuple(ElementTree.fromstring(kmz.read(name)) for name in kmz.namelist())  # type: ignore[return-value]


def test_places_on_earth_are_those_of_the_scene() -> None:
    found = points(5)
    there = enu_from_geodetic(np.array([[p.lat_deg, p.lon_deg, p.alt_m] for p in found]), ORIGIN)
    assert np.allclose(there, [one.xyz for one in advised(5)], atol=1e-3)
    assert all(p.up_m == pytest.approx(one.xyz[2] - LOWEST_M) for p, one in zip(found, advised(5), strict=True))
    assert all(-180 <= p.yaw_deg < 180 for p in found)


@pytest.mark.parametrize("count", [1, 20, MOST_POINTS, MOST_POINTS + 1, 301])
def test_a_mission_has_at_most_so_many_points_numbered_from_nought(count: int) -> None:
    files = list(missions(points(count), 20.0))
    assert len({name for name, _ in files}) == -(-count // MOST_POINTS)
    total = 0
    for _, content in files:
        for root in opened(content):
            index = [int(mark.findtext(f"{W}index") or -1) for mark in root.iter(f"{K}Placemark")]
            assert index == list(range(len(index))) and len(index) <= MOST_POINTS
        total += len(index)
    assert total == count


def test_all_that_is_required_is_there() -> None:
    template, waylines = opened(next(missions(points(3), 20.0))[1])
    for root, folder_has, point_has in ((template, TEMPLATE, TEMPLATE_POINT), (waylines, WAYLINE, WAYPOINT)):
        config, folder = root.find(f".//{W}missionConfig"), root.find(f".//{K}Folder")
        assert config is not None and folder is not None
        assert all(config.find(W + name) is not None for name in MISSION)
        assert all(folder.find(W + name) is not None for name in folder_has)
        for mark in folder.iter(f"{K}Placemark"):
            assert all(mark.find(W + name) is not None for name in point_has)
            actions = [one.findtext(f"{W}actionActuatorFunc") for one in mark.iter(f"{W}action")]
            assert actions == ["gimbalRotate", "takePhoto"]
            group = mark.find(f"{W}actionGroup")
            assert group is not None and group.findtext(f"{W}actionGroupStartIndex") == mark.findtext(f"{W}index")


def test_places_heights_and_angles_are_flown_as_meant() -> None:
    meant = points(4)
    _, waylines = opened(next(missions(meant, 20.0))[1])
    for mark, point in zip(waylines.iter(f"{K}Placemark"), meant, strict=True):
        lon, lat = map(float, (mark.findtext(f"{K}Point/{K}coordinates") or "").split(","))
        assert (lon, lat) == (pytest.approx(point.lon_deg, abs=1e-8), pytest.approx(point.lat_deg, abs=1e-8))
        assert float(mark.findtext(f"{W}executeHeight") or 0) == pytest.approx(point.up_m, abs=0.01)
        assert int(mark.findtext(f"{W}waypointHeadingParam/{W}waypointHeadingAngle") or 999) == round(point.yaw_deg)
        pitch = mark.findtext(f".//{W}gimbalPitchRotateAngle")
        assert float(pitch or 0) == pytest.approx(point.pitch_deg)


@pytest.mark.parametrize("clear_m", [20.0, 95.0])
def test_the_drone_comes_and_goes_above_all_that_is_known(clear_m: float) -> None:
    meant = points(9)
    config = opened(next(missions(meant, clear_m))[1])[1].find(f".//{W}missionConfig")
    assert config is not None
    height = max(clear_m, min(p.up_m for p in meant))
    assert float(config.findtext(f"{W}takeOffSecurityHeight") or 0) == pytest.approx(height, abs=0.01)
    assert float(config.findtext(f"{W}globalRTHHeight") or 0) == pytest.approx(height, abs=0.01)


def test_the_same_advice_makes_the_same_bytes() -> None:
    assert list(missions(points(5), 20.0)) == list(missions(points(5), 20.0))


def test_other_programs_read_the_places() -> None:
    found = points(3)
    marks = ElementTree.fromstring(kml(found, "a < b & c")).iter(f"{K}Point")
    told = [tuple(map(float, (mark.findtext(f"{K}coordinates") or "").split(","))) for mark in marks]
    headings = [f"heading {one.yaw_deg:.0f} deg" for one in advised(9)]
    assert all(one in kml(points(9), "").decode() for one in headings), "as the page has them, not below nought"
    features = json.loads(geojson(found, advised(3)))["features"]
    rows = list(csv.DictReader(io.StringIO(listing(advised(3), found))))
    for place, feature, row, point in zip(told, features, rows, found, strict=True):
        meant = (point.lon_deg, point.lat_deg, point.alt_m)
        assert np.allclose(place, meant, atol=0.01) and np.allclose(
            feature["geometry"]["coordinates"], meant, atol=0.01
        )
        assert float(row["lat_deg"]) == pytest.approx(point.lat_deg, abs=1e-7) and int(row["rank"]) == point.rank
    assert "lat_deg" not in listing(advised(1), None)
