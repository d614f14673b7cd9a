"""What is left in the Prefect UI has keys that Prefect takes; the journeys leave it for real."""

from __future__ import annotations

import re

import pytest

from aug3d_core.stages import STAGES
from tasks.artifacts import artifact_key


@pytest.mark.parametrize("stage", STAGES)
def test_every_stage_has_a_key_of_letters_digits_and_dashes(stage: str) -> None:
    assert re.fullmatch("[a-z0-9]+(-[a-z0-9]+)+", artifact_key(stage, "figures"))
