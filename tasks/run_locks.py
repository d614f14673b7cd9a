"""Which flow runs have a process that works on them, told by a lock that the kernel frees when the process ends."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from filelock import FileLock, Timeout
from prefect.runtime import flow_run

from aug3d_core.run.linux_process import SUPERVISED, die_with_parent
from aug3d_core.store import layout


@contextmanager
def run_lock(home: Path, flow_run_id: str | None = None) -> Iterator[None]:
    """Hold the lock of a flow run, the present one unless another is named, while its work lasts.

    A run of the worker's ends with the worker; until then it has nothing to do without Prefect's server, which does so too.
    """
    if SUPERVISED in os.environ:
        die_with_parent()
    lock = _lock(home, flow_run_id or str(flow_run.get_id()))
    with lock:
        yield
    Path(lock.lock_file).unlink(missing_ok=True)


def has_process(home: Path, flow_run_id: str) -> bool:
    """Say whether a flow run's process lives and works."""
    lock = _lock(home, flow_run_id)
    try:
        with lock.acquire(timeout=0):
            return False
    except Timeout:
        return True


def was_here(home: Path, flow_run_id: str) -> bool:
    """Say whether a process of this home worked on a flow run, and did not end it."""
    return (home / layout.ALIVE / f"{flow_run_id}.lock").exists()


def _lock(home: Path, flow_run_id: str) -> FileLock:
    folder = home / layout.ALIVE
    folder.mkdir(parents=True, exist_ok=True)
    return FileLock(folder / f"{flow_run_id}.lock")
