"""Workers of a Dask cluster make shards of what takes long here, to the same bytes; what becomes of them stops no work."""

from __future__ import annotations

import subprocess
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from aug3d_core import doctor
from aug3d_core.bench.s3_service import free_port
from aug3d_core.bench.small_town import SETTINGS
from aug3d_core.factory import cluster, scheduler
from aug3d_core.factory.build import Work, build, work_of
from aug3d_core.factory.cluster import order_of, ordered, with_cluster
from aug3d_core.factory.config import scene_config
from aug3d_core.factory.material import Source
from aug3d_core.factory.scheduler import DASK, asking, worker_count
from aug3d_core.factory.stages import TOWN
from aug3d_core.run.errors import StoreError, UsageError
from aug3d_core.store.layout import SHARED_VARIABLE
from aug3d_core.store.store import Store
from flows.services import healthy
from flows.serving import HELPER, SCHEDULER, Serving


def say(*_: object) -> None:
    pass


def town(**changed: Any) -> Work:
    values = scene_config("tiny").town.model_dump() | SETTINGS["town"] | {"photos_per_shard": 2} | changed
    return work_of(TOWN, TOWN.config.model_validate(values), {})


def test_an_order_is_for_the_same_object_or_none(tmp_path: Path) -> None:
    store, work = Store(tmp_path), town()
    order = order_of(work)
    assert order is not None and ordered(store, order).key == work.key
    with pytest.raises(UsageError, match="same versions"):
        ordered(store, order.model_copy(update={"key": "another"}))
    with pytest.raises(StoreError, match="photos abc"):
        ordered(store, order.model_copy(update={"inputs": {"photos": ("photos", "abc")}}))
    given = Source(path=tmp_path, digest="of photographs that the user gave")
    assert order_of(replace(work, sources={"folder": given})) is None


def test_without_a_cluster_a_step_is_made_as_it_is(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv(DASK, raising=False)
    assert with_cluster(Store(tmp_path), make := lambda visit: None) is make


@pytest.mark.slow
def test_a_cluster_that_is_not_there_stops_no_work(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    monkeypatch.setattr(scheduler, "CONNECT_S", 1)
    address = f"tcp://127.0.0.1:{free_port()}"
    with asking("antigravity", "", address, 0.0):
        time.sleep(0.1)
    assert f"no help from {address}" in caplog.text
    monkeypatch.setenv(DASK, address)
    monkeypatch.setenv(SHARED_VARIABLE, "s3://bucket")
    told = doctor._cluster()
    assert (told.state, told.remedy) == ("fail", f"start it, or leave {DASK} out")


@pytest.mark.slow
def test_each_worker_makes_shards_and_a_lost_one_costs_no_more(
    tmp_path: Path, shared: str, dask: tuple[str, dict[str, subprocess.Popen]], monkeypatch: pytest.MonkeyPatch
) -> None:
    address, running = dask
    monkeypatch.setenv(DASK, address)
    while worker_count(address) < 2:
        time.sleep(0.2)
    assert healthy(SCHEDULER, Serving(tmp_path), address) and healthy(HELPER, Serving(tmp_path), address)
    assert doctor._cluster().found == f"2 workers at {address}"
    monkeypatch.setattr(scheduler, "ASK_EVERY_S", 0.5)
    store, work = Store(tmp_path / "here"), town()
    order = order_of(work)
    assert order and store.shared
    with asking(cluster.__name__, order.model_dump_json(), address, 0.0):
        deadline = time.monotonic() + 240
        while len(store.shared.bucket.names(f"work/town/{work.key}/")) < 4:
            logs = "\n".join((tmp_path / f"{name}.log").read_text()[-2000:] for name in running)
            assert time.monotonic() < deadline, logs
            time.sleep(0.5)
            if (tmp_path / "one" / "work").exists() and (tmp_path / "two" / "work").exists():
                running["two"].kill()
        built = build(store, work, say)
    monkeypatch.delenv(SHARED_VARIABLE)
    alone = build(Store(tmp_path / "alone"), work, say)
    assert built.record.digest == alone.record.digest
