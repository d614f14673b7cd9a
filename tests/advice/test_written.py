"""What a folder of advice holds, with GPS and without."""

from __future__ import annotations

import csv
import json
import os
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from aug3d_core.advice.choice import Advised, Choice
from aug3d_core.advice.mission import waypoints
from aug3d_core.advice.page import advice_page, caution, verdict
from aug3d_core.advice.plan import Plan, plan_of
from aug3d_core.advice.route import along
from aug3d_core.advice.written import write_advice
from aug3d_core.run.errors import DiskFull, StoreError
from tests.advice.flown_site import ORIGIN, mesh, site, views, write_scene
from tests.export.full_disk import full_disk


def written(plan: Plan, folder: Path) -> str:
    write_advice(plan, "my <scene>", folder, lambda names: advice_page("my <scene>", plan, mesh(), names))
    return (folder / "advice.html").read_text()


def test_with_gps_there_are_files_for_the_field(tmp_path: Path) -> None:
    plan = plan_of(*write_scene(tmp_path, skipped_m=50.0, hole=True), [], 5, 15.0)
    page = written(plan, tmp_path / "advice")
    names = {path.name for path in (tmp_path / "advice").iterdir()}
    assert names == {"advice.html", "advice.csv", "advice.geojson", "advice.kml", "mission.kmz"}
    assert page.count('class="new"') == 5 and "mission.kmz" in page and "hole of the mesh" in page
    assert "my &lt;scene&gt;" in page and "<scene>" not in page and "poorly photographed" in verdict(plan)
    assert {*re.findall(r'<a href="([^"]+)"', page)} == names - {"advice.html"} and "North is up" in page


def test_the_page_counts_heights_as_the_mission_does(tmp_path: Path) -> None:
    plan = plan_of(*write_scene(tmp_path, skipped_m=50.0), [], 5, 15.0)
    valley = replace(plan.site.area, heights=plan.site.area.heights - 7.0)
    lower = replace(plan, site=replace(plan.site, area=valley))
    page = written(lower, tmp_path / "advice")
    up_m = {float(row["up_m"]) for row in csv.DictReader((tmp_path / "advice" / "advice.csv").read_text().splitlines())}
    assert lower.lowest_ground == pytest.approx(-7.0) and "<b>16 m above the lowest ground</b>" in page
    assert all(f">{height:.1f}</td>" in page for height in up_m)


def test_without_gps_there_are_none(tmp_path: Path) -> None:
    plan = plan_of(*write_scene(tmp_path, skipped_m=50.0, gps=False), [], 3, 15.0)
    page = written(plan, tmp_path / "advice")
    assert {path.name for path in (tmp_path / "advice").iterdir()} == {"advice.html", "advice.csv"}
    assert plan.origin is None and " unit" in page and "orth is up" not in page and "north up" not in page


def test_a_missing_mesh_is_named(tmp_path: Path) -> None:
    sfm, surface = write_scene(tmp_path)
    (surface / "baseline_mesh.ply").unlink()
    with pytest.raises(StoreError, match=r"baseline_mesh\.ply is missing"):
        plan_of(sfm, surface, [], 3, 15.0)


def test_where_nothing_is_missing_there_is_a_page(tmp_path: Path) -> None:
    plan = plan_of(*write_scene(tmp_path), [], 0, 15.0)
    assert 'class="new"' not in written(plan, tmp_path / "advice") and caution(plan) == ""


def by_hand(*advised: Advised, missing: float = 0.3, roof_m: float = 9.0) -> Plan:
    place = site(50.0, roof_m)
    nothing = np.zeros(len(place.samples.xyz))
    choice = Choice(advised, (missing,) * (len(advised) + 1), nothing, nothing)
    return Plan(place, views(50.0), choice, "m", np.array([*ORIGIN.values()]))


def test_where_much_is_missing_and_nothing_helps_it_is_not_said_that_nothing_is_missing() -> None:
    assert verdict(by_hand()).startswith("30% is missing of views like the flight's, but no photograph")
    assert verdict(by_hand(missing=0.001)).startswith("Nothing is missing")


def test_the_way_keeps_the_margin_over_what_it_passes(tmp_path: Path) -> None:
    plan = plan_of(*write_scene(tmp_path, skipped_m=50.0, roof_m=90.0), [], 12, 15.0)
    way = along(np.array([one.xyz for one in plan.choice.advised]), 1.0)
    assert np.allclose(way[:, 2], 105, atol=0.1)


@pytest.mark.parametrize("roof_m, too_high", [(90.0, False), (120.0, True)])
def test_where_the_margin_takes_the_drone_too_high_that_is_said(roof_m: float, too_high: bool) -> None:
    up_m = roof_m + 15
    said = caution(by_hand(Advised(1, (40.0, 40.0, up_m), 0.0, -90.0, 0.1, 0.5, 0.0, 1.0), roof_m=roof_m))
    assert (f"comes and goes {up_m:.0f} m above the take-off point: 15 m above all" in said) == too_high
    assert (f"up to {up_m:.0f} m above the ground" in said) == too_high


def test_below_which_altitude_nobody_may_take_off(tmp_path: Path) -> None:
    plan = plan_of(*write_scene(tmp_path, skipped_m=50.0), [], 3, 15.0)
    assert plan.origin is not None
    lowest = min(point.alt_m - point.up_m for point in waypoints(plan.choice.advised, plan.origin, plan.lowest_ground))
    assert plan.take_off_m == pytest.approx(lowest, abs=0.05) == pytest.approx(ORIGIN["alt_m"], abs=0.1)
    assert caution(plan).startswith("Do not take off below 540 m")
    assert "Do not take off below 540 m" in written(plan, tmp_path / "advice")
    other = plan_of(*write_scene(tmp_path / "no gps", skipped_m=50.0, gps=False), [], 3, 15.0)
    assert caution(other) == ""


def test_where_gps_told_no_altitudes_none_are_made_up(tmp_path: Path) -> None:
    sfm, surface = write_scene(tmp_path, skipped_m=50.0)
    world = json.loads((sfm / "world.json").read_text())
    (sfm / "world.json").write_text(json.dumps(world | {"origin": world["origin"] | {"alt_m": None}}))
    plan = plan_of(sfm, surface, [], 3, 15.0)
    assert plan.take_off_m is None and "GPS told no altitudes" in caution(plan)
    files = write_advice(plan, "town", tmp_path / "advice", lambda names: "a page")
    assert "mission.kmz" in files, "whose heights are above the take-off point"
    places = json.loads((tmp_path / "advice" / "advice.geojson").read_text())["features"]
    assert all(len(place["geometry"]["coordinates"]) == 2 for place in places)
    table = (tmp_path / "advice" / "advice.csv").read_text().splitlines()
    assert all(row["alt_m"] == "" for row in csv.DictReader(table))
    kml = (tmp_path / "advice" / "advice.kml").read_text()
    assert "absolute" not in kml and "relativeToGround" in kml and "nan" not in kml.lower()


def test_where_the_disk_is_full_it_is_named_and_nothing_is_left(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(os, "fsync", full_disk)
    with pytest.raises(DiskFull, match=f"{tmp_path}/advice: .*No space left"):
        written(by_hand(), tmp_path / "advice")
    assert not (tmp_path / "advice").exists()
