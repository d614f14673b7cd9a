"""A study that is named with what it was asked for is the same on any machine; workers of a Dask cluster make its cells."""

from __future__ import annotations

import subprocess
import time
from pathlib import Path

import pytest

import aug3d_core.studies.stability.catalogue  # noqa: F401  (a study brings Open3D with it: tests/processes.py must see it)
from aug3d_core.factory.scheduler import DASK, worker_count
from aug3d_core.run.errors import Aug3dError
from aug3d_core.store.store import Store
from aug3d_core.studies.common.trial import directly
from aug3d_core.studies.named import Asked
from aug3d_core.studies.stability.cell import StabilityResult

CHEAP = Asked(name="stability", given={"only": ["gps noise: the world"], "seeds": 1, "quick": True})


@pytest.mark.parametrize(
    ("asked", "told"),
    [
        (Asked(name="stability", given={"only": ["rain"], "seeds": 1, "quick": True}), "rain"),
        (Asked(name="paper", given={"study": "grouping", "scene": "none", "seeds": 1, "quick": True}), "none"),
        (Asked(name="generalisation", given={"collection": "none", "head": [], "seeds": 1}), "none"),
    ],
)
def test_wrong_words_are_told_before_anything_is_made(asked: Asked, told: str, tmp_path: Path) -> None:
    with pytest.raises(Aug3dError, match=told):
        asked.prepared(Store(tmp_path))


def test_what_is_told_to_another_machine_is_the_same_study(tmp_path: Path) -> None:
    there = Asked.model_validate_json(CHEAP.model_dump_json())
    assert there == CHEAP
    assert there.prepared(Store(tmp_path)).cells == CHEAP.prepared(Store(tmp_path)).cells == 2


@pytest.mark.slow
def test_workers_of_a_cluster_make_its_cells(
    tmp_path: Path, dask: tuple[str, dict[str, subprocess.Popen]], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv(DASK, dask[0])
    while worker_count(dask[0]) < 2:
        time.sleep(0.2)
    store, done = Store(tmp_path / "here"), list[StabilityResult]()
    prepared, deadline = CHEAP.prepared(store), time.monotonic() + 240
    with CHEAP.over_cluster():
        while len([*tmp_path.glob("one/objects/*/*")]) + len([*tmp_path.glob("two/objects/*/*")]) < 2:
            logs = "\n".join((tmp_path / f"{name}.log").read_text()[-2000:] for name in dask[1])
            assert time.monotonic() < deadline, logs
            time.sleep(0.2)
        found = prepared.carry_out(
            directly(store, lambda *_: None), lambda result, *_: done.append(result), "this machine"
        )
    # Which is done first is chance: what another is at comes later
    assert {result.cell.name: result.state for result in done} == {one.cell.name: one.state for one in found.results}
    assert len(done) == 2
    assert not found.silent and not found.crashes
