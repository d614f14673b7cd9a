"""A factory that is a formula, in place of the real one."""

from __future__ import annotations

import pytest

from tests.studies.tradeoff.stand_in import Stages, stand_in


@pytest.fixture
def stages(monkeypatch: pytest.MonkeyPatch) -> Stages:
    return stand_in(monkeypatch)
