"""A factory that is a formula, in place of the real one."""

from __future__ import annotations

import pytest
from tradeoff.stand_in import Stages, settle


@pytest.fixture
def stages(monkeypatch: pytest.MonkeyPatch) -> Stages:
    stand_in = Stages()
    monkeypatch.setattr("aug3d_core.bench.trial.make", stand_in.make)
    monkeypatch.setattr("aug3d_core.bench.trial.settle", settle)
    return stand_in
