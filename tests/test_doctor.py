"""The doctor says whether a GPU that is here is used."""

from __future__ import annotations

import subprocess
from typing import Any

import pytest

from aug3d_core import doctor


@pytest.mark.parametrize(
    ("torch_says", "state", "found", "remedy"),
    [
        ("2.11.0+cu130 True", "ok", "NVIDIA T4: training and prediction use it", ""),
        ("2.11.0+cpu False", "warn", "torch 2.11.0+cpu is built for the CPU", "without PIP_EXTRA_INDEX_URL"),
        ("2.11.0+cu130 False", "warn", "torch 2.11.0+cu130 does not see it", "driver"),
    ],
)
def test_a_gpu_that_is_not_used_is_told(
    torch_says: str, state: str, found: str, remedy: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    def answers(words: list[str], **_: Any) -> subprocess.CompletedProcess[str]:
        return subprocess.CompletedProcess(words, 0, torch_says + "\n", "")

    monkeypatch.setattr(doctor, "gpu_names", lambda: ["NVIDIA T4"])
    monkeypatch.setattr(doctor.subprocess, "run", answers)
    told = doctor._gpu()
    assert told.state == state and found in told.found and remedy in told.remedy


def test_without_a_gpu_torch_is_not_asked(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(doctor, "gpu_names", list)
    monkeypatch.setattr(doctor.subprocess, "run", lambda *_, **__: pytest.fail("it was asked"))
    assert doctor._gpu().found == "none; everything runs on the CPU"


def test_the_question_is_one_that_torch_answers(monkeypatch: pytest.MonkeyPatch) -> None:
    import torch

    monkeypatch.setattr(doctor, "gpu_names", lambda: ["NVIDIA T4"])
    told = doctor._gpu()
    assert (told.state == "ok") == torch.cuda.is_available()
    assert torch.cuda.is_available() or torch.__version__ in told.found
