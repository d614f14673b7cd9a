"""An adjustment that ruins a point which had no part in it is no gain."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pycolmap
import pytest

from aug3d_core.sfm import control_adjustment as module
from aug3d_core.sfm.control import survey
from aug3d_core.sfm.control_adjustment import adjust_to_control
from tests.sfm.test_align import Flight
from tests.sfm.test_control import marked


@pytest.mark.parametrize("lost", [[], ["P2"], ["P0", "P1", "P2", "P3", "P4", "P5"]])
def test_points_that_are_lost_do_not_count_as_exact(monkeypatch: pytest.MonkeyPatch, lost: list[str]) -> None:
    """The other points come ten times as near; only where none is lost is that a reason to adjust."""
    told = survey(marked(Flight(3), noise_px=2.0))
    errors = told.table.set_index("point").filter(regex="^error_")
    bent = errors / 10
    bent.loc[lost] = np.nan
    bends: list[str] = []
    monkeypatch.setattr(module, "thinned", lambda model, points: model)
    monkeypatch.setattr(module, "_left_out", lambda *given: bent)
    monkeypatch.setattr(module, "_bend", lambda *given: bends.append("bent"))
    monkeypatch.setattr(module, "without_wrong_points", lambda model: None)
    monkeypatch.setattr(module, "_off_m", lambda model, marks, names, told: bent)
    found = adjust_to_control(pycolmap.Reconstruction(), pd.DataFrame({"line": []}), told)
    assert found.used == bool(bends) == (not lost)
    moved_m = np.sqrt(np.square(errors.to_numpy()).sum(axis=1).mean())
    assert found.moved_m == pytest.approx(moved_m)
    assert found.adjusted_m == (None if lost else pytest.approx(moved_m / 10))
