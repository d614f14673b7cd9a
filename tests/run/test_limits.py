"""Limits come from the environment; without them a stage may take most of the machine, for long."""

from __future__ import annotations

import pytest

from aug3d_core.run.errors import UsageError
from aug3d_core.run.limits import LIMIT_HOURS, LIMIT_MEMORY, Limits, limits_from
from aug3d_core.run.memory import total_bytes

DEFAULT = Limits(7 * 24 * 3600, 0.9 * total_bytes() / 2**20)


def test_the_defaults_are_the_machines() -> None:
    assert limits_from({}) == DEFAULT
    assert limits_from({LIMIT_HOURS: "", LIMIT_MEMORY: " "}) == DEFAULT, (
        "docker-compose passes on what is not set as nothing"
    )


def test_each_is_set_alone() -> None:
    assert limits_from({LIMIT_HOURS: "0.5"}) == Limits(1800, DEFAULT.mib)
    assert limits_from({LIMIT_MEMORY: "100"}) == Limits(DEFAULT.seconds, 102_400)


@pytest.mark.parametrize("name", [LIMIT_HOURS, LIMIT_MEMORY])
@pytest.mark.parametrize("value", ["0", "-1", "nan", "inf", "20G", "a day"])
def test_what_cannot_be_right_is_refused_by_name(name: str, value: str) -> None:
    with pytest.raises(UsageError, match=f"{name} is '{value}'") as caught:
        limits_from({name: value})
    assert f"leave {name} out" in caught.value.remedy
