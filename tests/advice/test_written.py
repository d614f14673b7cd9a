"""What a folder of advice holds, with GPS and without."""

from __future__ import annotations

from pathlib import Path

import pytest

from aug3d_core.advice.mission import waypoints
from aug3d_core.advice.page import advice_page, caution, verdict
from aug3d_core.advice.plan import Plan, plan_of
from aug3d_core.advice.written import write_advice
from aug3d_core.run.errors import StoreError
from tests.advice.flown_site import ORIGIN, mesh, write_scene


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


def test_without_gps_there_are_none(tmp_path: Path) -> None:
    plan = plan_of(*write_scene(tmp_path, skipped_m=50.0, gps=False), [], 3, 15.0)
    page = written(plan, tmp_path / "advice")
    assert {path.name for path in (tmp_path / "advice").iterdir()} == {"advice.html", "advice.csv"}
    assert plan.origin is None and " unit" in page


def test_a_missing_mesh_is_named(tmp_path: Path) -> None:
    sfm, surface = write_scene(tmp_path)
    (surface / "baseline_mesh.ply").unlink()
    with pytest.raises(StoreError, match=r"baseline_mesh\.ply is missing"):
        plan_of(sfm, surface, [], 3, 15.0)


def test_where_nothing_is_missing_there_is_a_page(tmp_path: Path) -> None:
    plan = plan_of(*write_scene(tmp_path), [], 0, 15.0)
    assert 'class="new"' not in written(plan, tmp_path / "advice") and caution(plan) == ""


def test_below_which_altitude_nobody_may_take_off(tmp_path: Path) -> None:
    plan = plan_of(*write_scene(tmp_path, skipped_m=50.0), [], 3, 15.0)
    assert plan.origin is not None
    lowest = min(point.alt_m - point.up_m for point in waypoints(plan.choice.advised, plan.origin, plan.lowest_ground))
    assert plan.take_off_m == pytest.approx(lowest, abs=0.05) == pytest.approx(ORIGIN["alt_m"], abs=0.1)
    assert caution(plan).startswith("Do not take off below 540 m")
    assert "Do not take off below 540 m" in written(plan, tmp_path / "advice")
    other = plan_of(*write_scene(tmp_path / "no gps", skipped_m=50.0, gps=False), [], 3, 15.0)
    assert caution(other) == ""
