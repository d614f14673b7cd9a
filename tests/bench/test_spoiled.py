"""What `aug3d bench look` counts as found, and as a false alarm."""

from __future__ import annotations

from pathlib import Path

from aug3d_core.bench.spoiled import recalled, spoil
from aug3d_core.look.survey import survey_of
from tests.look.flown import lines, take


def test_what_is_spoiled_is_found_and_the_rest_is_an_alarm(tmp_path: Path) -> None:
    shots = lines(5, 11)
    photos = sorted(take(tmp_path / "flown", shots).iterdir())
    spoil(photos, tmp_path / "spoiled")
    names = [photo.name for photo in photos]
    survey = survey_of(tmp_path / "spoiled", lambda *_: None)
    assert recalled(survey, names) == (5, 0)
    assert recalled(survey, names[::-1]) == (0, 5), "others than those that were spoiled"
    assert recalled(survey_of(tmp_path / "flown", lambda *_: None), names) == (0, 0)
