"""The page of a first look."""

from __future__ import annotations

import re
from dataclasses import replace
from datetime import timedelta
from pathlib import Path

import pytest

from aug3d_core.factory.estimate.calibration import REFERENCE
from aug3d_core.look.cost import PRESETS, costs_of
from aug3d_core.look.findings import findings_of
from aug3d_core.look.page import look_page
from aug3d_core.look.survey import survey_of
from tests.look.flown import lines, take


def looked(folder: Path) -> str:
    survey = survey_of(folder, lambda *_: None)
    return look_page(survey, findings_of(survey), costs_of(survey, REFERENCE))


def test_everything_is_on_one_page_that_needs_no_network(tmp_path: Path) -> None:
    shots = lines(5)
    shots[3] = replace(shots[3], told_m=(0.0, 2000.0))
    page = looked(take(tmp_path / "coast", shots))
    assert "coast" in page and "cannot be right" in page and "20 m" in page
    assert page.count('class="at ') == len(shots) - 1, "every photograph but the one of which nobody knows where it was"
    assert page.count("data:image/jpeg;base64,") == len(shots)
    assert all(f">{preset}</td>" in page for preset in PRESETS)
    assert {*re.findall(r'href="#(p\d+)"', page)} <= {*re.findall(r'id="(p\d+)"', page)}
    assert not re.search(r'(?:src|href)="(?!data:|#)', page)
    assert "North is up" in page and all(f"</i>{word}<" in page for word in ("photograph", "blurred"))


def test_a_folder_of_broken_files_has_a_page_that_says_so(tmp_path: Path) -> None:
    for name in "ab":
        (tmp_path / f"{name}.jpg").write_bytes(b"no picture")
    survey = survey_of(tmp_path, lambda *_: None)
    page = look_page(survey, findings_of(survey), {})
    assert "0 usable photographs" in page and "2 photographs cannot be used" in page and "will not do" in page


def test_the_median_overlap_says_where_there_is_none(tmp_path: Path) -> None:
    shots = lines(5)
    far = [replace(shot, east_m=90.0) if shot.name == "shot_009.jpg" else shot for shot in shots]
    assert "; none in" not in looked(take(tmp_path / "good", shots, gps=False))
    assert re.search(
        r"overlap of neighbours <b>\d\d%; none in 2 of 39</b>", looked(take(tmp_path / "far", far, gps=False))
    )


@pytest.mark.parametrize("gps", [False, True])
def test_names_are_text_and_never_markup(tmp_path: Path, gps: bool) -> None:
    name = "<img src=x onerror=alert(1)>&.jpg"
    shots = [replace(shot, name=name) if i == 2 else shot for i, shot in enumerate(lines(1, 4))]
    page = looked(take(tmp_path / "a<b>", shots, gps=gps))
    assert "<img src=x" not in page and "a<b>" not in page
    assert "&lt;img src=x onerror=alert(1)&gt;&amp;.jpg" in page


def test_of_many_photographs_those_with_nothing_wrong_are_shown_in_part(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("aug3d_core.look.page._MOST_PICTURES", 5)
    shots = lines(3)
    shots[4] = replace(shots[4], told_m=(0.0, 2000.0))
    page = looked(take(tmp_path, shots))
    assert 5 <= page.count("data:image/jpeg;base64,") <= 7
    assert re.search(r"Of 1\d more", page) and 'id="p4"' in page
    linked, shown = ({*re.findall(f'{name}"#?(p\\d+)"', page)} for name in ("href=", "id="))
    assert linked == shown - {"p4"} and page.count('class="at ') == len(shots) - 1


def test_a_flight_of_two_days_in_a_folder_with_a_space(tmp_path: Path) -> None:
    shots = lines(5)
    one_day = looked(take(tmp_path / "my flight", shots))
    assert "2026-05-01 12:00 to 12:02" in one_day
    assert f"--photos &#x27;{tmp_path}/my flight&#x27; --dry-run" in one_day
    shots[-1] = replace(shots[-1], time=shots[-1].time + timedelta(hours=21))
    assert "2026-05-01 12:00 to 2026-05-02 09:02" in looked(take(tmp_path / "two", shots))


def test_positions_that_contradict_each_other_have_a_page(tmp_path: Path) -> None:
    shots = [replace(shot, told_m=(9000.0 * (i // 2), 0.0)) for i, shot in enumerate(lines(1, 4))]
    page = looked(take(tmp_path, shots))
    assert page.count('class="at ') == 4
