"""GPUs are told by the driver's own program, and a machine without one, or with one that does not answer, has none."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from aug3d_core.bench.machine import describe_machine
from aug3d_core.run.gpus import gpu_names


def driver(folder: Path, monkeypatch: pytest.MonkeyPatch, script: str) -> None:
    """Put a program in place of nvidia-smi."""
    program = folder / "nvidia-smi"
    program.write_text(f"#!/bin/sh\n{script}\n")
    program.chmod(0o755)
    monkeypatch.setenv("PATH", f"{folder}{os.pathsep}{os.environ['PATH']}")


def test_each_gpu_has_its_name(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    driver(tmp_path, monkeypatch, 'test "$1" = --query-gpu=name && printf "NVIDIA H100 80GB HBM3\\nNVIDIA T4\\n"')
    assert gpu_names() == ["NVIDIA H100 80GB HBM3", "NVIDIA T4"]
    assert "NVIDIA H100 80GB HBM3, NVIDIA T4" in describe_machine()


@pytest.mark.parametrize("script", ["echo 'has failed because it could not communicate' >&2; exit 9", "exit 0"])
def test_a_driver_that_fails_or_knows_none(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, script: str) -> None:
    driver(tmp_path, monkeypatch, script)
    assert gpu_names() == []


def test_without_a_driver_there_is_none(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PATH", str(tmp_path))
    assert gpu_names() == []
