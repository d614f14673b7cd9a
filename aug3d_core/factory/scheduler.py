"""The Dask cluster whose scheduler AUG3D_DASK names: whether it may be used, who works for it, and what they are asked.

Only an order goes to the scheduler, as JSON. What a worker makes of it goes to the shared store.
"""

from __future__ import annotations

import logging
import os
import subprocess
import sys
import time
from collections.abc import Callable, Mapping
from contextlib import AbstractContextManager
from functools import partial
from importlib.util import find_spec
from pathlib import Path
from tempfile import TemporaryFile
from threading import Event
from typing import TYPE_CHECKING
from urllib.parse import urlsplit

from aug3d_core.run.beside import beside
from aug3d_core.run.errors import Aug3dError, UsageError
from aug3d_core.run.linux_process import die_with_parent
from aug3d_core.store.layout import SHARED_VARIABLE
from aug3d_core.store.store import Store

if TYPE_CHECKING:
    from distributed import Client, Future

DASK = "AUG3D_DASK"
CONNECT_S = 20
ASK_EVERY_S = 30.0  # workers join and leave
_LOOK_EVERY_S = 1.0
_LOOPBACK = ("localhost", "127.0.0.1", "::1")
_log = logging.getLogger(__name__)


def scheduler_from(environment: Mapping[str, str]) -> str:
    """Return the address of the scheduler, "" if none is named; raises UsageError if it cannot be used."""
    address = environment.get(DASK, "").strip()
    if not address:
        return ""
    try:
        parts = urlsplit(address)
        known = parts.scheme in ("tcp", "tls") and bool(parts.hostname) and bool(parts.port)
    except ValueError:
        known = False
    if not known:
        raise UsageError(f"{DASK} is {address!r}", "give the address of a Dask scheduler, e.g. tls://scheduler:8786")
    if parts.scheme == "tcp" and parts.hostname not in _LOOPBACK:
        raise UsageError(
            f"{DASK} is {address}: whoever reaches a Dask scheduler without TLS can run anything on its workers",
            "give it a certificate and name it as tls://HOST:PORT (see docs.dask.org, TLS), or reach it through an SSH tunnel",
        )
    if not environment.get(SHARED_VARIABLE, "").strip():
        raise UsageError(
            f"{DASK} is set, but {SHARED_VARIABLE} is not", "Dask's workers hand over through a shared store"
        )
    if find_spec("distributed") is None:
        raise UsageError(f"{DASK} is set, but Dask is not installed", "pip install 'aug3d[dask]'")
    return address


def worker_count(address: str) -> int:
    """Return how many workers a scheduler has; raises UsageError if it does not answer."""
    from distributed import Client

    try:
        with Client(address, timeout=CONNECT_S, set_as_default=False) as client:
            return len(client.scheduler_info(n_workers=-1)["workers"])
    except (OSError, TimeoutError, RuntimeError) as error:
        raise UsageError(
            f"no Dask scheduler answers at {address}: {error}", f"start it, or leave {DASK} out"
        ) from error


def asking(module: str, order: str, address: str, after_s: float) -> AbstractContextManager[None]:
    """Have each worker of a cluster run a module with an order on its standard input, while a block runs.

    Without a cluster the block runs without help. after_s: how long the block runs before anyone is asked [s].
    """
    return beside(lambda over: _ask(module, order, address, after_s, over))


def _ask(module: str, order: str, address: str, after_s: float, over: Event) -> None:
    if over.wait(after_s):
        return
    try:
        from distributed import Client

        with Client(address, timeout=CONNECT_S, set_as_default=False) as client:
            _keep_asking(client, module, order, over)
    except Exception as error:  # whatever a cluster may do, the work is done here
        _log.warning("no help from %s: %s: %s", address, type(error).__name__, error)


def _keep_asking(client: Client, module: str, order: str, over: Event) -> None:
    asked: dict[str, Future] = {}
    told = set[str]()
    while True:
        for worker in client.scheduler_info(n_workers=-1)["workers"].keys() - asked.keys():
            asked[worker] = client.submit(run_there, module, order, workers=[worker], pure=False, retries=0)
        if over.wait(ASK_EVERY_S):
            break
        for worker, future in asked.items():
            if future.status == "error" and worker not in told:
                told.add(worker)
                _log.warning("no help from %s: %s", worker, future.exception())
    client.cancel(list(asked.values()), force=True)  # those not begun; the others see it


def run_there(module: str, order: str, grace_s: float = 30.0) -> None:
    """Run a module with an order, on a worker of Dask's: in a process of its own, which may start others.

    Who is no longer wanted, since all is made or who asked has been killed, has `grace_s` to end by itself. Raises
    RuntimeError with its last words if it fails.
    """
    from distributed import get_worker

    worker = get_worker()
    key, wanted = worker.get_current_task(), time.monotonic()
    with TemporaryFile("w+") as asked, TemporaryFile("w+") as said:
        asked.write(order)
        asked.seek(0)
        command = [sys.executable, "-m", module]
        as_child = partial(die_with_parent, parent=os.getpid())
        process = subprocess.Popen(command, stdin=asked, stdout=said, stderr=said, preexec_fn=as_child)
        while process.poll() is None:
            time.sleep(_LOOK_EVERY_S)
            task = worker.state.tasks.get(key)
            if task is not None and task.state == "executing":
                wanted = time.monotonic()
            elif time.monotonic() - wanted > grace_s:
                process.kill()
        if process.returncode:
            said.seek(0)
            raise RuntimeError((said.read().strip() or f"exit code {process.returncode}").splitlines()[-1])


def obey(do: Callable[[Store, str], object]) -> None:
    """Do what is asked for on standard input, with this machine's home and the shared store; exit in words if that fails."""
    try:
        store = Store(Path(os.environ.get("AUG3D_HOME", "aug3d_data")))
        if store.shared is None:
            raise UsageError(
                f"{SHARED_VARIABLE} is not set on this machine", "start Dask's workers with it and its keys"
            )
        with store.using():
            do(store, sys.stdin.read())
    except Aug3dError as error:
        sys.exit(f"{error.problem} -> {error.remedy}")
