"""The end of a run as a person reads it."""

from __future__ import annotations

import io
from pathlib import Path
from typing import Any

import pytest
from rich.console import Console

from aug3d_core.store.scenes import version_metrics
from flows.summary import command, print_summary
from tests.tasks.logged import version


def printed(metrics: dict[str, Any]) -> str:
    console = Console(file=io.StringIO(), width=200)
    print_summary(console, metrics)
    assert isinstance(console.file, io.StringIO)
    return console.file.getvalue()


def test_what_mlflow_was_not_told_is_said(tmp_path: Path) -> None:
    metrics = version_metrics(version(tmp_path))
    assert "note" not in printed(metrics)
    why = "MLflow at http://127.0.0.1:5 cannot be used: [Errno 111] refused; the next run logs what it was not told"
    assert f"note {why}" in printed(metrics | {"mlflow": {"run_id": "", "url": "", "waiting": why}})


def test_the_home_s_own_runs_are_seen_behind_the_guard_and_others_where_they_are(tmp_path: Path) -> None:
    metrics = version_metrics(version(tmp_path / "my home"))
    assert f"aug3d up --home '{tmp_path}/my home'\n" in printed(metrics)
    for address in ("https://mlflow.here", "sqlite:////elsewhere/mlflow.db"):
        told = printed(metrics | {"paths": metrics["paths"] | {"mlflow": address}})
        assert f"MLflow  {address}\n" in told and "aug3d up" not in told


def test_what_auto_decided_is_told_with_its_reason(tmp_path: Path) -> None:
    metrics = version_metrics(version(tmp_path))
    row = {"step": "depth", "fold": 0, "by": "auto", "field": "depth.max_px", "value": 288, "measured": "views of 96 px",
           "rule": "3 times that", "saves": "", "costs": ""}  # fmt: skip
    told = printed(metrics | {"needs": [row, row | {"by": "sfm", "field": "sfm.mapper"}]})
    assert "depth.max_px" in told and "288" in told and "3 times that" in told and "sfm.mapper" not in told


def test_notes_and_places_are_text_and_never_markup(tmp_path: Path) -> None:
    metrics = version_metrics(version(tmp_path / "home [raw]"))
    stage = next(iter(metrics["stages"]))
    metrics["stages"][stage]["notes"] = ["folder [raw] is odd"]
    told = printed(metrics)
    assert f"note {stage}: folder [raw] is odd" in told and f"{tmp_path}/home [raw]/" in told


def test_a_next_step_names_the_home_that_it_would_not_find(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.delenv("AUG3D_HOME", raising=False)
    assert command(Path("aug3d_data"), "show", "toy").endswith("aug3d show toy")
    assert command(Path("my home"), "show", "toy").endswith("aug3d show toy --home 'my home'")
    monkeypatch.setenv("AUG3D_HOME", str(tmp_path / "my home"))
    assert command(Path("my home"), "show", "toy").endswith("aug3d show toy")
    assert command(Path("aug3d_data"), "show", "toy").endswith("aug3d show toy --home aug3d_data")
