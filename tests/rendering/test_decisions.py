from __future__ import annotations

from aug3d_core.rendering.decisions import decision
from aug3d_core.rendering.probe import Chosen


def test_fewer_samples_say_what_they_save() -> None:
    found = decision(Chosen(24, 40.2, "fewest"))
    assert found.value == 24 and "81%" in found.saves and "40.2 dB" in found.measured
    assert not decision(Chosen(4, None, "set by hand")).saves, "nothing was compared"
