"""Goals hold on their own side, and the machine is named."""

from __future__ import annotations

from aug3d_core.bench.figure import at_least, at_most
from aug3d_core.bench.machine import describe_machine


def test_a_goal_holds_on_its_own_side_and_never_for_nothing() -> None:
    assert at_least(22.0, 22.0, "dB").holds and not at_least(22.0, 21.9, "dB").holds
    assert at_most(0.1, 0.1, "%").holds and not at_most(0.1, 0.2, "%").holds
    assert at_least(1.0, None, "share").holds is False and at_most(1.0, None, "s").holds is False


def test_the_machine_is_described() -> None:
    assert "cores" in describe_machine() and "GiB" in describe_machine()
