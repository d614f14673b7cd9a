"""What is left in the Prefect UI has keys that Prefect takes; the journeys leave it for real."""

from __future__ import annotations

import re

import pytest

from aug3d_core.factory.stages import STAGES
from tasks import artifacts
from tasks.artifacts import PrefectProgress, artifact_key


@pytest.mark.parametrize("stage", STAGES)
def test_every_stage_has_a_key_of_letters_digits_and_dashes(stage: str) -> None:
    assert re.fullmatch("[a-z0-9]+(-[a-z0-9]+)+", artifact_key(stage, "figures"))


def test_a_server_that_refuses_a_report_ends_no_study(monkeypatch: pytest.MonkeyPatch, caplog) -> None:
    def refuse(*_: object, **__: object) -> None:
        raise ConnectionError("500")

    monkeypatch.setattr(artifacts, "create_progress_artifact", refuse)
    monkeypatch.setattr(artifacts, "artifact_key", lambda *words: "-".join(words))
    PrefectProgress().advanced("cells", 1, 2, "town")
    assert "could not be reported: ConnectionError: 500" in caplog.text
