"""Run a stage's job in a process group of its own, with a log, a time limit, a memory limit and a captured end.

Native libraries abort, leak, hang and cannot be interrupted in a thread; two of them in one process corrupt memory. So no
engine ever runs in the process that orchestrates. SIGKILL alone ends some of them, and it goes to the whole group.
"""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

import psutil

from aug3d_core.errors import StageFailed
from aug3d_core.parent import SUPERVISED
from aug3d_core.stage import Progress, Stage
from aug3d_core.store import layout

_POLL_S = 0.1
_LOG_LINES = 15
_DISK_FULL_BYTES = 8 * 2**20
_stopping = threading.Event()


@dataclass(frozen=True)
class Cost:
    """What a finished job cost: wall seconds, and peak resident memory summed over its processes."""

    seconds: float
    peak_mib: float


def stop_all() -> None:
    """Kill every running job of this process and refuse new ones."""
    _stopping.set()


def allow_jobs() -> None:
    """Take back `stop_all`, for a process that goes on to another run."""
    _stopping.clear()


# OpenMP's threads wait for each other by spinning. Beside other work that made a training step 7 times slower (measured:
# 8.3 s against 1.2 s on 2 busy cores); on idle cores sleeping costs nothing measurable.
QUIET_THREADS = {"OMP_WAIT_POLICY": "PASSIVE"}


def run_isolated(stage: Stage, folder: Path, progress: Progress) -> Cost:
    """Run `folder/job.json` and wait for it; raises StageFailed with the cause, the last log lines and the replay command."""
    for stale in (layout.ERROR, layout.OUTCOME, layout.PROGRESS):
        (folder / stale).unlink(missing_ok=True)
    started = time.monotonic()
    with (folder / layout.LOG).open("ab") as log:
        process = subprocess.Popen(
            [sys.executable, "-m", stage.package, str(folder / layout.JOB)],
            stdin=subprocess.DEVNULL,
            stdout=log,
            stderr=subprocess.STDOUT,
            start_new_session=True,
            env={**QUIET_THREADS, **os.environ, SUPERVISED: "1", "PYTHONUNBUFFERED": "1"},
        )
    try:
        peak_mib, verdict = _watch(process, stage, folder, started, progress)
    finally:
        _kill_group(process)
    if verdict is None and process.returncode == 0 and (folder / layout.OUTCOME).exists():
        return Cost(seconds=time.monotonic() - started, peak_mib=peak_mib)
    raise _failure(stage, folder, process.returncode, verdict)


def _watch(
    process: subprocess.Popen, stage: Stage, folder: Path, started: float, progress: Progress
) -> tuple[float, tuple[str, str] | None]:
    """Wait for the end; return the peak memory in MiB and, if the job was stopped from here, (cause, problem)."""
    limit_mib = min(stage.limit_mib, 0.9 * psutil.virtual_memory().total / 2**20)
    report = _progress_reader(folder, progress)
    peak_mib = 0.0
    while process.poll() is None:
        peak_mib = max(peak_mib, _group_mib(process.pid))
        report()
        if _stopping.is_set():
            return peak_mib, ("killed", "the run was stopped")
        if time.monotonic() - started > stage.limit_s:
            return peak_mib, ("timeout", f"it ran longer than {stage.limit_s:.0f} s")
        if peak_mib > limit_mib:
            return peak_mib, ("memory", f"it used {peak_mib:.0f} MiB; the limit is {limit_mib:.0f} MiB")
        time.sleep(_POLL_S)
    report()
    return peak_mib, None


def _progress_reader(folder: Path, progress: Progress) -> Callable[[], None]:
    seen = b""

    def report() -> None:
        nonlocal seen
        try:
            content = (folder / layout.PROGRESS).read_bytes()
        except FileNotFoundError:
            return
        if content != seen:
            seen = content
            state = json.loads(content)
            progress(state["done"], state["total"], state["what"])

    return report


def _group_mib(pid: int) -> float:
    try:
        leader = psutil.Process(pid)
        family = [leader, *leader.children(recursive=True)]
    except psutil.NoSuchProcess:
        return 0.0
    total = 0
    for member in family:
        try:
            total += member.memory_info().rss
        except psutil.NoSuchProcess:
            continue
    return total / 2**20


def _kill_group(process: subprocess.Popen) -> None:
    """End what is left of the group: the job itself, or workers that it started and lost."""
    with suppress(ProcessLookupError):
        os.killpg(process.pid, signal.SIGKILL)
    process.wait()


def _failure(stage: Stage, folder: Path, returncode: int, verdict: tuple[str, str] | None) -> StageFailed:
    cause, problem, remedy = _diagnose(folder, returncode, verdict)
    free = psutil.disk_usage(str(folder)).free
    if cause != "disk" and verdict is None and free < _DISK_FULL_BYTES:
        cause, problem = "disk", f"no space left on the disk of {folder}"
    if cause == "disk":
        remedy = (
            f"free some space (now {free / 2**20:.0f} MiB free) or choose another disk with --home DIR, then run again"
        )
    tail = log_tail(folder / layout.LOG)
    replay = f"{sys.executable} -m {stage.package} {folder / layout.JOB}"
    return StageFailed(stage.name, cause, problem, remedy, tail, replay)


def _diagnose(folder: Path, returncode: int, verdict: tuple[str, str] | None) -> tuple[str, str, str]:
    if verdict is not None:
        remedies = {
            "killed": "run the same command again: it goes on where it was",
            "timeout": "use a smaller preset or fewer photographs",
            "memory": "use a smaller preset or fewer photographs",
        }
        return *verdict, remedies[verdict[0]]
    try:
        told = json.loads((folder / layout.ERROR).read_bytes())
    except (FileNotFoundError, ValueError):
        told = None
    if told is not None:
        return told["cause"], told["problem"], told["remedy"]
    if returncode == -signal.SIGKILL:
        return (
            "killed",
            "it was killed (SIGKILL), perhaps for want of memory",
            "close other programs or use a smaller preset, then run again",
        )
    if returncode < 0:
        name = signal.Signals(-returncode).name
        return (
            "crash",
            f"native code crashed with {name}",
            "run the replay command to see it again; the log has a stack",
        )
    return "error", f"it ended with exit code {returncode} and no result", "read the log, then run the replay command"


def log_tail(log: Path) -> str:
    """Return the last lines of a log, readable whatever bytes native code wrote."""
    try:
        return "\n".join(log.read_text(errors="replace").splitlines()[-_LOG_LINES:])
    except FileNotFoundError:
        return ""
