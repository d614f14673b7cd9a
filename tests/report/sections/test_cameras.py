import re

import pytest

from aug3d_core.report.reported_run import ReportedRun
from aug3d_core.report.sections.cameras import cameras
from aug3d_core.report.sections.tracks import tracks
from aug3d_core.sfm.files import WORLD
from tests.report.made_up_run import EVIL, flown


def test_photographs_are_counted_and_those_left_out_have_a_reason(tmp_path):
    page = cameras(flown(tmp_path))
    assert "<b>13</b> photographs read, 1 refused" in page and "<b>12 of 13</b> have a pose" in page
    assert "torn.jpg" in page and "unreadable" in page and "too blurred" in page
    assert "1 could not be read, 1 have no pose" in page
    assert "1 show the same as the photograph before" in page and "not needed" in page


@pytest.mark.parametrize(
    ("word", "px", "said"),
    [
        (
            "seen",
            (3.5, 4.5, 33.0),
            "seen, 3.5 to 4.5 px from the first row to the last (99 % interval), rows read in 33 ms.",
        ),
        ("not seen", (-0.2, 0.3, None), "not seen, -0.2 to 0.3 px from the first row to the last (99 % interval)."),
        ("cannot be told", (-2.0, 3.0, None), "cannot be told, -2 to 3 px from"),
        ("cannot be told", (None, None, None), "cannot be told, for too few photographs"),
    ],
)
def test_the_shutter_is_told_with_its_interval(tmp_path, word, px, said):
    run = flown(tmp_path)
    placed = run.record("sfm").metrics
    placed["rolling_shutter"] = word
    placed |= dict(zip(("rolling_shutter_low_px", "rolling_shutter_high_px", "readout_ms"), px, strict=True))
    assert f"Rolling shutter: {said}" in cameras(run)


def test_runs_from_before_say_nothing_of_the_shutter(tmp_path):
    assert "hutter" not in cameras(flown(tmp_path))


def test_no_name_of_a_file_becomes_html(tmp_path):
    page = cameras(flown(tmp_path))
    assert (
        EVIL not in page and page.count("&lt;script&gt;alert(1)&lt;/script&gt;.jpg") == 2
    )  # unplaced, and in the table


def test_errors_are_those_of_the_files(tmp_path):
    page = cameras(flown(tmp_path))
    assert "4,000 points; mean 0.500 px" in page
    assert "12 photographs with GPS; RMS error [m]: east 3.00, north 4.00, up 0.00" in page
    assert "median 5" in page
    rows = re.findall(r"<tr><td[^>]*>1[01]\d .*?</tr>", page)
    assert len(rows) == 12 and ">5.00<" in rows[0]
    assert any("104 p4.jpg" in row and ">0<" in row for row in rows)  # the made-up tracks are of three photographs
    assert sum(">4,000<" in row and ">0.500<" in row for row in rows) == 3


def test_without_gps_that_is_said(tmp_path):
    run = flown(tmp_path)
    (tmp_path / "sfm" / WORLD).write_text('{"metric": false, "unit": "scene unit", "origin": null}')
    assert "Lengths are nominal" in cameras(run) and "RMS error" not in cameras(run)


def test_a_run_that_read_no_photo_says_nothing_of_them():
    assert cameras(ReportedRun([], {"stages": {}})) == "" == tracks(ReportedRun([], {"stages": {}}))


def test_tracks_and_overlap_are_counted(tmp_path):
    run = flown(tmp_path)
    page = tracks(run)
    assert "4,000 points; a point is seen by 3.00 photographs on average, median 3" in page
    assert run.seen_by is not None
    ground = run.seen_by[run.seen_by >= 0]
    share = float(re.findall(r"(\d+) % of the mapped surface", page)[0])
    assert share == pytest.approx(100 * (ground >= 5).mean(), abs=0.5) and ground.max() == 6
