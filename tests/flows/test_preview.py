"""What `aug3d predict --photos` tells, and how it leaves."""

from __future__ import annotations

import io
import json
from pathlib import Path
from types import SimpleNamespace

import pytest
from rich.console import Console

from aug3d_core.factory.material import Source
from aug3d_core.novel.files import PREVIEW_FLIGHT, PREVIEW_SHEET, PREVIEW_VIEWS
from aug3d_core.store.store import Store
from flows import preview as previewing

FIGURES = {"photographs": 8, "preview_psnr": 24.1, "over_best_cheap_db": 0.5, "over_best_cheap_low_db": -0.25}


def test_all_that_is_told_is_shown_whatever_brackets_it_has() -> None:
    console = Console(file=io.StringIO(), width=300)
    places = {what: f"/photos [raw]/{what}" for what in ("sheet", "flight", "views")}
    previewing._print(console, {"metrics": FIGURES, **places, "notes": ["photos [raw] differ"], "seconds": 9.0})
    assert isinstance(console.file, io.StringIO)
    told = console.file.getvalue()
    assert "+0.50 dB [at least -0.25] over the better answer" in told
    assert "/photos [raw]/sheet" in told and "note photos [raw] differ" in told


@pytest.mark.parametrize(("state", "code"), [("ok", 0), ("degraded", 3)])
def test_a_model_that_may_be_no_help_ends_with_three(
    state: str, code: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "made" / PREVIEW_VIEWS).mkdir(parents=True)
    for name in (PREVIEW_SHEET, PREVIEW_FLIGHT):
        (tmp_path / "made" / name).touch()
    record = SimpleNamespace(state=state, metrics=FIGURES, notes=("one",), seconds=61.0)
    poses = SimpleNamespace(metrics={"registered": 8}, notes=())
    source = Source(path=tmp_path, digest="d")
    monkeypatch.setattr(previewing, "model_named", lambda *_: source)
    monkeypatch.setattr(previewing, "source_of", lambda *_: source)
    monkeypatch.setattr(
        previewing, "walk", lambda *_: [SimpleNamespace(step=SimpleNamespace(name="sfm"), record=poses)]
    )
    monkeypatch.setattr(previewing, "build", lambda *_: SimpleNamespace(record=record, cached=False))
    monkeypatch.setattr(Store, "files_dir", lambda *_: tmp_path / "made")
    for as_json in (True, False):
        left = previewing.preview(Store(tmp_path / "home"), tmp_path, "towns", tmp_path / f"out{as_json}", as_json)
        assert left == code
        told = capsys.readouterr().out
        assert json.loads(told)["state"] == state if as_json else "8 photographs have a pose" in told
