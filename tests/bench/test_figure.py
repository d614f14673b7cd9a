"""A goal is held or missed, and work in a process of its own leaves nothing behind in this one."""

from __future__ import annotations

import os

from aug3d_core.bench.figure import at_least, at_most, in_own_process


def test_what_could_not_be_measured_holds_no_goal() -> None:
    assert [figure.holds for figure in (at_least(3, 3, "dB"), at_least(3, 2.9, "dB"), at_least(3, None, "dB"))] == [
        True,
        False,
        False,
    ]
    assert [figure.holds for figure in (at_most(3, 3, "s"), at_most(3, 3.1, "s"), at_most(3, None, "s"))] == [
        True,
        False,
        False,
    ]


def test_work_runs_in_a_process_of_its_own() -> None:
    assert in_own_process(os.getpid) != os.getpid()
