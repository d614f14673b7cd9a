"""Is this machine able? Each check says what it found and, where that is not enough, the one thing to do."""

from __future__ import annotations

import os
import secrets
import shutil
import subprocess
import sys
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Literal

from aug3d_core.factory.scheduler import DASK, scheduler_from, worker_count
from aug3d_core.run.errors import StoreError, UsageError
from aug3d_core.run.gpus import gpu_names
from aug3d_core.run.limits import LIMIT_HOURS, LIMIT_MEMORY, limits_from
from aug3d_core.run.memory import total_bytes
from aug3d_core.run.stage import Frozen
from aug3d_core.store.layout import SHARED_VARIABLE

# Each engine is imported in a process of its own: two native libraries in one process corrupt memory.
_ENGINES = ("pycolmap", "open3d", "bpy", "torch")
# Shared library -> Debian package, for what the wheels leave to the system; the set-up reads the same list.
_LIBRARIES = Path(__file__).with_name("system_libraries.txt")
_NEED_DISK_GIB, _NEED_MEMORY_GIB = 3, 6


class Check(Frozen):
    """One thing looked at."""

    name: str
    state: Literal["ok", "warn", "fail"]
    found: str
    remedy: str = ""


def examine(home: Path) -> list[Check]:
    """Look at everything a run needs."""
    here = [_python(), *map(_engine, _ENGINES), _memory(), _limits(), _disk(home), _cores(), _gpu()]
    shared = [_shared_store()] if os.environ.get(SHARED_VARIABLE) else []
    return [*here, *shared, *([_cluster()] if os.environ.get(DASK) else [])]


def _python() -> Check:
    found = sys.version.split()[0]
    if sys.version_info[:2] == (3, 11):
        return Check(name="python", state="ok", found=found)
    return Check(
        name="python",
        state="fail",
        found=found,
        remedy="bpy has wheels for Python 3.11 only: run make demo, which fetches one",
    )


def _engine(name: str) -> Check:
    try:
        found = version(name)
    except PackageNotFoundError:
        return Check(name=name, state="fail", found="not installed", remedy="run make demo, which installs it")
    done = subprocess.run([sys.executable, "-c", f"import {name}"], capture_output=True, text=True, timeout=300)
    if done.returncode == 0:
        return Check(name=name, state="ok", found=found)
    lines = done.stderr.strip().splitlines() or [f"exit code {done.returncode}"]
    packages = dict(line.split() for line in _LIBRARIES.read_text().splitlines())
    missing = next((package for library, package in packages.items() if library in done.stderr), None)
    remedy = f"apt-get install -y {missing}" if missing else "run make demo, which installs the system libraries"
    return Check(name=name, state="fail", found=f"{found} cannot be imported: {lines[-1]}", remedy=remedy)


def _memory() -> Check:
    gib = total_bytes() / 2**30
    state = "ok" if gib >= _NEED_MEMORY_GIB else "warn"
    return Check(name="memory", state=state, found=f"{gib:.1f} GiB", remedy=f"the demo needs {_NEED_MEMORY_GIB} GiB")


def _limits() -> Check:
    try:
        limits = limits_from(os.environ)
    except UsageError as error:
        return Check(name="limits", state="fail", found=error.problem, remedy=error.remedy)
    found = f"a stage may take {limits.mib / 1024:.1f} GiB ({LIMIT_MEMORY}) and {limits.seconds / 3600:.0f} h ({LIMIT_HOURS})"
    return Check(name="limits", state="ok", found=found)


def _disk(home: Path) -> Check:
    place = next(folder for folder in (home.resolve(), *home.resolve().parents) if folder.exists())
    gib = shutil.disk_usage(place).free / 2**30
    state = "ok" if gib >= _NEED_DISK_GIB else "warn"
    if not os.access(place, os.W_OK):
        return Check(
            name="disk",
            state="fail",
            found=f"{place} cannot be written",
            remedy="choose another folder with --home DIR",
        )
    return Check(
        name="disk", state=state, found=f"{gib:.0f} GiB free at {place}", remedy=f"the demo needs {_NEED_DISK_GIB} GiB"
    )


def _shared_store() -> Check:
    """Try what sharing rests on: of two who create a name one wins, and what was written is listed at once."""
    from aug3d_core.store.bucket import Bucket

    try:
        place = Bucket(os.environ[SHARED_VARIABLE])
        name = f"doctor/{secrets.token_hex(8)}"
        first, second = place.create(name, b"first"), place.create(name, b"second")
        listed = place.names("doctor/") + ([] if place.get(name) == b"first" else [""])
        place.delete([name])
    except (StoreError, UsageError) as error:
        return Check(name="store", state="fail", found=error.problem, remedy=error.remedy)
    if not first or second:
        found = f"{place.url} lets two create one name (it ignores If-None-Match): two machines would make one thing"
        return Check(name="store", state="fail", found=found, remedy="use a service that keeps conditional writes")
    if name not in listed or "" in listed:
        found = f"{place.url} does not show at once what was written"
        return Check(name="store", state="fail", found=found, remedy="use a service that lists after a write")
    return Check(name="store", state="ok", found=f"{place.url}: conditional writes and lists hold")


def _cluster() -> Check:
    try:
        address = scheduler_from(os.environ)
        workers = worker_count(address)
    except UsageError as error:
        return Check(name="dask", state="fail", found=error.problem, remedy=error.remedy)
    state = "ok" if workers else "warn"
    remedy = f"start some: dask worker {address}, with the same {SHARED_VARIABLE}"
    return Check(name="dask", state=state, found=f"{workers} workers at {address}", remedy=remedy)


def _cores() -> Check:
    return Check(name="cores", state="ok", found=str(len(os.sched_getaffinity(0))))


def _gpu() -> Check:
    """Say whether a GPU that is here is used: a torch built for the CPU trains without a word."""
    names = gpu_names()
    if not names:
        return Check(name="gpu", state="ok", found="none; everything runs on the CPU")
    told = ", ".join(names)
    ask = "import torch; print(torch.__version__, torch.cuda.is_available())"
    done = subprocess.run([sys.executable, "-c", ask], capture_output=True, text=True, timeout=300)
    if done.returncode != 0:
        return Check(name="gpu", state="ok", found=told)  # what is wrong with torch is told beside it
    build, _, seen = done.stdout.strip().rpartition(" ")
    if seen == "True":
        return Check(name="gpu", state="ok", found=f"{told}: training and prediction use it")
    why = f"torch {build} is built for the CPU" if build.endswith("+cpu") else f"torch {build} does not see it"
    remedy = (
        "remove .venv and install again without PIP_EXTRA_INDEX_URL"
        if build.endswith("+cpu")
        else "see whether `nvidia-smi` tells a driver that is new enough for this torch"
    )
    return Check(name="gpu", state="warn", found=f"{told}, but {why}: everything runs on the CPU", remedy=remedy)
