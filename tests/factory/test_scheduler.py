"""A scheduler is used where nobody else can reach it, or by TLS, and where there is a store to hand over through."""

from __future__ import annotations

import subprocess
import time
from pathlib import Path

import psutil
import pytest

from aug3d_core.factory.scheduler import DASK, run_there, scheduler_from
from aug3d_core.run.errors import UsageError
from aug3d_core.store.layout import SHARED_VARIABLE


@pytest.mark.parametrize(
    "address", ["scheduler", "http://127.0.0.1:8786", "tcp://127.0.0.1", "tls://:8786", "tcp://[::1:8786"]
)
def test_what_is_no_address_is_refused(address: str) -> None:
    with pytest.raises(UsageError, match=DASK):
        scheduler_from({DASK: address, SHARED_VARIABLE: "s3://bucket"})


def test_an_open_scheduler_is_used_on_this_machine_only() -> None:
    shared = {SHARED_VARIABLE: "s3://bucket"}
    with pytest.raises(UsageError, match="without TLS"):
        scheduler_from({DASK: "tcp://10.0.0.7:8786", **shared})
    for address in ("tls://10.0.0.7:8786", "tcp://127.0.0.1:8786", "tcp://[::1]:8786"):
        assert scheduler_from({DASK: address, **shared}) == address


def test_without_a_shared_store_there_is_nothing_to_hand_over_through() -> None:
    assert scheduler_from({}) == scheduler_from({DASK: " "}) == ""
    with pytest.raises(UsageError, match=SHARED_VARIABLE):
        scheduler_from({DASK: "tcp://127.0.0.1:8786"})


@pytest.mark.slow
def test_what_a_worker_runs_ends_when_nobody_wants_it_and_its_failure_is_told(
    tmp_path: Path, dask: tuple[str, dict[str, subprocess.Popen]]
) -> None:
    from distributed import Client

    told = tmp_path / "told"
    with Client(dask[0], timeout=60, set_as_default=False) as client:
        client.wait_for_workers(2, timeout=60)
        with pytest.raises(RuntimeError, match="No module named"):
            client.submit(run_there, "antigravitation", "", pure=False).result(60)
        future = client.submit(run_there, "tests.factory.asleep", str(told), grace_s=1.0, pure=False)
        while not (told.exists() and told.read_text()):
            assert future.status == "pending"
            time.sleep(0.1)
        process = psutil.Process(int(told.read_text()))
    process.wait(30)  # whoever asked has gone, as one does that is killed
