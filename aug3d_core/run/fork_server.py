"""Start stages quickly: fork them from a server process that has imported the common libraries.

The server is that of `multiprocessing`. It starts with the first stage and ends with the factory, even after a SIGKILL; so
do all stages. It imports nothing of aug3d, so that each stage runs the code that is there when it begins.
"""

from __future__ import annotations

import atexit
import gc
import multiprocessing
import os
import runpy
import signal
import sys
import threading
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from functools import cache
from multiprocessing import forkserver, get_context, popen_fork, spawn
from pathlib import Path

from aug3d_core.run.linux_process import die_with_parent

# Libraries that most stages import. No engine: two of them in one process corrupt memory, and some start threads, which do
# not survive a fork.
PRELOAD = [
    "matplotlib.backends.backend_agg",
    "matplotlib.figure",
    "numpy",
    "pandas",
    "PIL.Image",
    "psutil",
    "pyarrow.parquet",
    "pydantic",
    "scipy.interpolate",
    "scipy.ndimage",
    "scipy.optimize",
    "scipy.sparse.csgraph",
    "scipy.spatial.transform",
    "skimage.measure",
    "zarr",
]
# Variables that the libraries above, or Python itself, read only once.
_READ_ONCE = ("OMP_", "OPENBLAS_", "MKL_", "NUMEXPR_", "MPL", "LD_", "PYTHONHASHSEED")

LOST = 255  # the exit code of a stage whose server was killed, which takes its stages along
_LOOK_S = 1.0  # far longer than a start takes
_one_start = threading.Lock()


def start(package: str, job: Path, log: Path, environment: Mapping[str, str]) -> popen_fork.Popen:
    """Run `python -m package job` in a session of its own, with its output appended to a log.

    The stage is forked, unless a variable that is read only once has changed since the server started: then a new
    interpreter runs it. `environment` must agree with this process's in these variables, as far as preloaded libraries
    read them.
    """
    with _one_start, _awake():
        context = get_context("forkserver" if _read_once() == _read_by_server() else "spawn")
        given = (package, str(job), str(log), dict(environment), os.getpid())
        process = context.Process(target=_become, args=given)  # pyright: ignore[reportAttributeAccessIssue]
        describe = spawn.get_preparation_data
        # A child would import the factory's main module, and with it Prefect.
        spawn.get_preparation_data = lambda name: {k: v for k, v in describe(name).items() if "main" not in k}
        try:
            try:
                return process._Popen(process)  # `Process.start` lets any thread read the exit code of any process
            except ConnectionError:  # the server was killed a moment ago; a new one is started now
                time.sleep(_LOOK_S)
                return process._Popen(process)
        finally:
            spawn.get_preparation_data = describe


@contextmanager
def _awake() -> Iterator[None]:
    """Keep the server going while a stage is asked of it: one that somebody stopped (SIGSTOP) would never answer."""
    done = threading.Event()

    def look() -> None:
        while not done.wait(_LOOK_S):
            pid = forkserver._forkserver._forkserver_pid  # pyright: ignore[reportAttributeAccessIssue]
            if pid is not None:
                with suppress(ProcessLookupError):
                    os.kill(pid, signal.SIGCONT)

    threading.Thread(target=look, daemon=True).start()
    try:
        yield
    finally:
        done.set()


def _read_once() -> dict[str, str]:
    return {name: value for name, value in os.environ.items() if name.startswith(_READ_ONCE)}


@cache
def _read_by_server() -> dict[str, str]:
    multiprocessing.set_forkserver_preload(PRELOAD)  # it starts now
    return _read_once()


def _become(package: str, job: str, log: str, environment: dict[str, str], factory: int) -> None:
    """Run `python -m package job` in this new process."""
    gc.freeze()  # a collection would write to, and so copy, all that was preloaded
    die_with_parent(parent=factory)
    os.setsid()  # Ctrl-C reaches the factory alone, which then ends its stages
    held = forkserver._forkserver._forkserver_alive_fd  # pyright: ignore[reportAttributeAccessIssue]
    if held is not None:
        os.close(held)  # the server lives as long as anybody holds this pipe: only the factory shall
    os.environ.clear()
    os.environ.update(environment)
    try:
        nothing, output = os.open(os.devnull, os.O_RDONLY), os.open(log, os.O_WRONLY | os.O_APPEND | os.O_CREAT, 0o666)
    except OSError as error:
        sys.exit(error.errno)  # as a stage that cannot write its error
    for source, end in ((nothing, 0), (output, 1), (output, 2)):
        os.dup2(source, end)
    os.close(nothing)
    os.close(output)
    sys.stdout = sys.__stdout__ = open(1, "w", buffering=1, closefd=False)  # noqa: SIM115
    sys.stderr = sys.__stderr__ = open(2, "w", buffering=1, closefd=False, errors="backslashreplace")  # noqa: SIM115
    sys.argv = [package, job]
    try:
        runpy.run_module(package, run_name="__main__", alter_sys=True)
    finally:
        atexit._run_exitfuncs()
        _leave_the_log()


def _leave_the_log() -> None:
    """Throw away what a full disk has no room for: else the process would end of that, and not with its own exit code."""
    for stream in (sys.stdout, sys.stderr):
        try:
            stream.flush()
        except OSError:
            os.dup2(os.open(os.devnull, os.O_WRONLY), stream.fileno())
