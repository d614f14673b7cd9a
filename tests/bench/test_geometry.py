"""Every setting that the benchmark turns exists, and takes every value that is tried."""

from __future__ import annotations

import pytest

from aug3d_core.bench.figure import at_least, at_most
from aug3d_core.bench.geometry import SETTINGS, Setting
from aug3d_core.bench.machine import describe_machine
from aug3d_core.scene_config import scene_config
from aug3d_core.stages import STAGES


@pytest.mark.parametrize("setting", SETTINGS, ids=lambda setting: setting.field)
def test_settings_exist_and_values_are_allowed(setting: Setting) -> None:
    for value in setting.values:
        scene_config("tiny", [f"{setting.field}={value}"])
    assert {*setting.stages, setting.judge} <= set(STAGES)


def test_a_goal_holds_on_its_own_side_and_never_for_nothing() -> None:
    assert at_least(22.0, 22.0, "dB").holds and not at_least(22.0, 21.9, "dB").holds
    assert at_most(0.1, 0.1, "%").holds and not at_most(0.1, 0.2, "%").holds
    assert at_least(1.0, None, "share").holds is False and at_most(1.0, None, "s").holds is False


def test_the_machine_is_described() -> None:
    assert "cores" in describe_machine() and "GiB" in describe_machine()
