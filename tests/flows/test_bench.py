"""`aug3d bench` keeps what it measured, and nobody else's measurement is lost by it."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path

import pytest
from click.testing import Result
from typer.testing import CliRunner

from aug3d_core.bench.figure import Figure
from aug3d_core.store.store import Store
from flows.cli import app

pytestmark = pytest.mark.slow


def test_a_benchmark_that_is_being_measured_is_left_alone(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def bench() -> Result:
        return CliRunner().invoke(app, ["bench", "nerf", "--home", str(tmp_path)])

    def measure(store: Store, *_: object) -> dict[str, Figure]:
        if (store.root / "half").exists():
            return {}  # the second came in
        (store.root / "half").write_text("made")
        second = bench()
        assert second.exit_code == 1 and "another process is making bench nerf" in second.output
        assert (store.root / "half").exists()
        return {"figure": Figure(1.0, "s")}

    monkeypatch.setattr("aug3d_core.bench.nerf.figures", measure)
    first = bench()
    assert first.exit_code == 0, first.output
    assert len(list((tmp_path / "bench").glob("nerf-*/figures.json"))) == 1
    assert not (tmp_path / "bench" / "nerf").exists()


def test_a_log_is_told_each_stage_as_it_begins(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def measure(store: Store, scene: object, say: Callable[[str, int, int, str], None]) -> dict[str, Figure]:
        for stage in ("depth", "training"):
            for done in range(3):
                say(stage, done, 3, "photos [of many]")
        return {"figure": Figure(1.0, "s")}

    monkeypatch.setattr("aug3d_core.bench.nerf.figures", measure)
    told = CliRunner().invoke(app, ["bench", "nerf", "--home", str(tmp_path)])
    assert told.exit_code == 0, told.output
    assert re.findall(r"\d\d:\d\d:\d\d (\S+) \.\.\.", told.stderr) == ["depth", "training"]
