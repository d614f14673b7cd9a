import json
import re
from html import unescape

import numpy as np
import pandas as pd
import pytest

from aug3d_core.domes.files import CAMERAS, DOME_TABLE
from aug3d_core.factory.plan import Step
from aug3d_core.factory.stages import STAGES
from aug3d_core.photos.files import PHOTO_TABLE
from aug3d_core.report.reported_run import ReportedRun
from aug3d_core.report.sections.gps import gps_errors
from aug3d_core.report.sections.overview import overview
from tests.report.made_up_run import EVIL, flown, record


def circles(page: str) -> list[tuple[str, int, float, float]]:
    found = re.findall(r'<circle class="cam ([^"]*)" data-view="(\d+)" cx="([\d.]+)" cy="([\d.]+)"', page)
    return [(kind, int(view), float(x), float(y)) for kind, view, x, y in found]


def test_every_camera_is_drawn_where_it_stands_in_the_colour_of_its_role(tmp_path):
    page = overview(flown(tmp_path))
    drawn = circles(page)
    assert [view for _, view, _, _ in drawn] == list(range(12))
    assert sum("train" in kind for kind, *_ in drawn) == 6 and sum("target" in kind for kind, *_ in drawn) == 2
    x, y = np.array([(x, y) for *_, x, y in drawn]).T
    assert np.allclose(np.diff(x)[:5], np.diff(x)[0], atol=0.2) and (np.diff(x)[:5] > 0).all()  # east is right
    assert (y[:6] > y[6:]).all()  # the second strip is 30 m north
    assert np.ptp(y) / np.ptp(x) == pytest.approx(0.3, abs=0.01)


def test_few_groups_that_hold_all_photos_are_coloured(tmp_path):
    page = overview(flown(tmp_path))
    kinds = [kind.split()[-1] for kind, *_ in circles(page)[:6]]
    assert kinds == ["g0"] * 3 + ["g1"] * 3  # the third group adds nobody
    assert "colours show 2 of 3 groups" in page
    assert json.loads(unescape(re.findall('data-groups="([^"]*)"', page)[0])) == [[0, 1, 2], [3, 4, 5], [1, 2, 3]]


def test_names_of_files_are_text_and_nothing_else(tmp_path):
    page = overview(flown(tmp_path))
    assert EVIL not in page and "&lt;script&gt;alert(1)&lt;/script&gt;.jpg: train" in page


def test_gps_errors_are_what_they_were_made_and_drawn_at_a_stated_scale(tmp_path):
    run = flown(tmp_path)
    assert np.allclose(gps_errors(run), [3, 4, 0], atol=0.01)
    page = overview(run)
    times = float(re.findall(r"GPS errors, ([\d.]+) times", page)[0])
    line = re.findall(r'class="gps-error" d="M([\d.]+) ([\d.]+)L([\d.]+) ([\d.]+)', page)[0]
    x, y, gps_x, gps_y = map(float, line)
    assert run.frame is not None
    px = times * run.frame.px
    assert (gps_x - x, gps_y - y) == pytest.approx((-3 * px, 4 * px), abs=0.2)  # towards GPS; y is down


def test_altitude_may_be_missing_from_gps(tmp_path):
    run = flown(tmp_path)
    path = tmp_path / "photos" / PHOTO_TABLE
    pd.read_parquet(path).assign(alt_m=np.nan).to_parquet(path)
    errors = gps_errors(run)
    assert np.isnan(errors[:, 2]).all() and np.allclose(errors[:, :2], [3, 4], atol=0.1)


def test_domes_and_places_passed_over_are_on_the_map(tmp_path):
    run = flown(tmp_path)
    dome = {"dome_id": 0, "x": 50.0, "y": 15.0, "cell": 20.0, "views": 2, "why": "cell of 20"}
    passed = dome | {"dome_id": -1, "views": 0, "why": "cell of 20, passed over: <nothing> there"}
    files = tmp_path / "sampling"
    files.mkdir()
    pd.DataFrame([dome, passed]).to_parquet(files / DOME_TABLE)
    np.savez(files / CAMERAS, world_from_cam=np.tile(np.eye(4), (2, 1, 1)))
    page = overview(ReportedRun([*run.made, (Step(STAGES["sampling"]), record("sampling"), files)], run.metrics))
    assert run.frame is not None
    (width,) = re.findall(r'class="cell"[^>]*width="([\d.]+)"', page)
    assert float(width) == pytest.approx(20 * run.frame.px, abs=0.1)
    assert page.count('class="passed"') == 1 and "&lt;nothing&gt; there" in page and "dome 0: 2 views" in page


def test_without_cameras_there_is_no_map():
    assert overview(ReportedRun([], {"stages": {}})) == ""
