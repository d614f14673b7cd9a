"""A Dask scheduler and two workers, as docker-compose.yml starts them."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path

import pytest

from aug3d_core.bench.s3_service import free_port
from aug3d_core.factory.scheduler import DASK
from flows.serving import HELPER, SCHEDULER


@pytest.fixture
def dask(tmp_path: Path, shared: str) -> Iterator[tuple[str, dict[str, subprocess.Popen]]]:
    """Run a scheduler and two workers, each with a home of its own; yield the address and the workers."""
    address = f"tcp://127.0.0.1:{free_port()}"
    with ExitStack() as stack:
        running = {}
        for name, service in {"scheduler": SCHEDULER, "one": HELPER, "two": HELPER}.items():
            log = stack.enter_context((tmp_path / f"{name}.log").open("w"))
            place = {"AUG3D_HOME": str(tmp_path / name), DASK: address}
            command = [sys.executable, "-m", "flows.services", service]
            running[name] = subprocess.Popen(command, env={**os.environ, **place}, stdout=log, stderr=log)
            stack.callback(running[name].wait)
            stack.callback(running[name].kill)
        yield address, running
