"""Run a stage's job in a process group of its own, with a log, a time limit, a memory limit and a captured end.

Native libraries abort, leak, hang and cannot be interrupted in a thread; two of them in one process corrupt memory. So no
engine ever runs in the process that orchestrates. SIGKILL alone ends some of them, and it goes to the whole group.
"""

from __future__ import annotations

import json
import os
import signal
import sys
import time
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import asdict, dataclass
from multiprocessing.popen_fork import Popen
from pathlib import Path

import psutil

from aug3d_core.run.errors import StageFailed
from aug3d_core.run.files import ERROR, JOB, LOG, OUTCOME, PROGRESS, SPENT
from aug3d_core.run.fork_server import LOST, start
from aug3d_core.run.full_disk import NO_ROOM_BYTES, NO_ROOM_ERRORS, disk_of, free_bytes, says_disk_full
from aug3d_core.run.limits import LIMIT_HOURS, LIMIT_MEMORY, Limits, limits_from
from aug3d_core.run.linux_process import SUPERVISED
from aug3d_core.run.memory_meter import MemoryMeter
from aug3d_core.run.stage import Progress, Stage

_POLL_S = 0.1
_SAVE_S = 1.0  # of the cost so far
_LOG_LINES = 15


@dataclass(frozen=True)
class Cost:
    """What a job cost: wall seconds; and over all its processes, processor seconds and peak memory by shares (PSS).

    Processor seconds say what the work is worth whatever else the machine is doing.
    """

    seconds: float
    cpu_seconds: float
    peak_mib: float

    def after(self, earlier: Cost) -> Cost:
        """Return what both tries cost that one piece of work took."""
        return Cost(
            earlier.seconds + self.seconds,
            earlier.cpu_seconds + self.cpu_seconds,
            max(earlier.peak_mib, self.peak_mib),
        )


# OpenMP's threads wait for each other by spinning. Beside other work that made a training step 7 times slower (measured:
# 8.3 s against 1.2 s on 2 busy cores); on idle cores sleeping costs nothing measurable.
QUIET_THREADS = {"OMP_WAIT_POLICY": "PASSIVE"}


def run_isolated(stage: Stage, folder: Path, progress: Progress) -> Cost:
    """Run `folder/job.json` and wait for it; raises StageFailed with the cause, the last log lines and the replay command.

    The limits are those of the environment.
    The cost is that of all tries that the folder has seen: what a killed one made is what the next one goes on with.
    """
    limits = limits_from(os.environ)
    for stale in (ERROR, OUTCOME, PROGRESS):
        (folder / stale).unlink(missing_ok=True)
    environment = {**QUIET_THREADS, **os.environ, SUPERVISED: str(os.getpid()), "PYTHONUNBUFFERED": "1"}
    process = start(stage.package, folder / JOB, folder / LOG, environment)
    earlier, started, room = _spent(folder), time.monotonic(), _Room(folder)
    saved_s = 0.0

    def look(now: Cost) -> None:
        nonlocal saved_s
        room.look()
        if now.seconds - saved_s > _SAVE_S:
            _save(now.after(earlier), folder)
            saved_s = now.seconds

    try:
        cost, verdict = _watch(process, limits, folder, started, progress, look)
    finally:
        _kill_group(process)
    if verdict is None and process.wait() == 0 and (folder / OUTCOME).exists():
        (folder / SPENT).unlink(missing_ok=True)
        return cost.after(earlier)
    raise _failure(stage, folder, process.wait() or 0, verdict, room)


class _Room:
    """The least that was free on a disk while a job ran: its temporary files, which filled it, may be gone at its end."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.least_bytes = free_bytes(folder)

    def look(self) -> None:
        self.least_bytes = min(self.least_bytes, free_bytes(self.folder))


def _spent(folder: Path) -> Cost:
    """Return what earlier tries in a work folder cost."""
    try:
        return Cost(**json.loads((folder / SPENT).read_bytes()))
    except (FileNotFoundError, ValueError, TypeError):  # none, or the machine went down while it was written
        return Cost(0.0, 0.0, 0.0)


def _save(cost: Cost, folder: Path) -> None:
    part = folder / f"{SPENT}.part"
    with suppress(OSError):  # a full disk ends the job with its own words
        part.write_text(json.dumps(asdict(cost)))
        part.replace(folder / SPENT)


def _watch(
    process: Popen, limits: Limits, folder: Path, started: float, progress: Progress, look: Callable[[Cost], None]
) -> tuple[Cost, tuple[str, str] | None]:
    """Wait for the end; return the cost and, if the job was stopped from here, (cause, problem).

    `look(cost so far)` is called again and again.
    """
    meter = MemoryMeter(limits.mib * 2**20)
    report = _progress_reader(folder, progress)
    cost = Cost(0.0, 0.0, 0.0)
    while process.poll() is None:
        job = _processes(process.pid)
        meter.look(job)
        seconds = time.monotonic() - started
        cost = Cost(seconds, max(cost.cpu_seconds, _cpu_seconds(job)), meter.peak_bytes / 2**20)
        report()
        look(cost)
        if cost.seconds > limits.seconds:
            return cost, ("timeout", f"it ran longer than {limits.seconds:.0f} s")
        if cost.peak_mib > limits.mib:
            return cost, ("memory", f"it used {cost.peak_mib:.0f} MiB; the limit is {limits.mib:.0f} MiB")
        time.sleep(_POLL_S)
    report()
    look(cost)  # it may have ended of a disk that was full only since the last look
    return cost, None


def _progress_reader(folder: Path, progress: Progress) -> Callable[[], None]:
    seen = b""

    def report() -> None:
        nonlocal seen
        try:
            content = (folder / PROGRESS).read_bytes()
        except FileNotFoundError:
            return
        if content != seen:
            seen = content
            state = json.loads(content)
            progress(state["done"], state["total"], state["what"])

    return report


def _processes(pid: int) -> list[psutil.Process]:
    with suppress(psutil.NoSuchProcess):
        leader = psutil.Process(pid)
        return [leader, *leader.children(recursive=True)]
    return []


def _cpu_seconds(job: Sequence[psutil.Process]) -> float:
    spent = 0.0
    for process in job:
        with suppress(psutil.NoSuchProcess):
            spent += sum(process.cpu_times()[:4])  # its own and its ended children's, user and system
    return spent


def _kill_group(process: Popen) -> None:
    """End what is left of the group: the job itself, or workers that it started and lost."""
    with suppress(ProcessLookupError):
        os.killpg(process.pid, signal.SIGKILL)
    process.kill()  # it may have no group of its own yet
    process.wait()


def _failure(stage: Stage, folder: Path, returncode: int, verdict: tuple[str, str] | None, room: _Room) -> StageFailed:
    cause, problem, remedy = _diagnose(folder, returncode, verdict)
    tail = log_tail(folder / LOG)
    no_room = room.least_bytes < NO_ROOM_BYTES or says_disk_full(tail.rpartition("\n")[2])
    if cause == "disk" or (cause in ("error", "crash", "killed") and no_room):
        full, remedy = disk_of(problem, folder)
        written = f", where it had written {_mib_under(folder)} MiB" if full == folder else ""
        cause, problem = "disk", f"no space left on the disk of {full}{written}: {problem}"
    replay = f"{sys.executable} -m {stage.package} {folder / JOB}"
    return StageFailed(stage.name, cause, problem, remedy, tail, replay)


def _diagnose(folder: Path, returncode: int, verdict: tuple[str, str] | None) -> tuple[str, str, str]:
    if verdict is not None:
        variable = {"timeout": LIMIT_HOURS, "memory": LIMIT_MEMORY}[verdict[0]]
        return *verdict, f"set {variable} higher, or use a smaller preset or fewer photographs"
    try:
        told = json.loads((folder / ERROR).read_bytes())
    except (FileNotFoundError, ValueError):
        told = None
    if told is not None:
        return told["cause"], told["problem"], told["remedy"]
    if returncode in NO_ROOM_ERRORS:
        return "disk", "not even its error could be written", ""
    if returncode == -signal.SIGKILL:
        return (
            "killed",
            "it was killed (SIGKILL), perhaps for want of memory",
            "close other programs or use a smaller preset, then run again",
        )
    if returncode == LOST:
        return "killed", "it was killed with the process that starts stages (the fork server)", "run again"
    if returncode < 0:
        name = signal.Signals(-returncode).name
        return (
            "crash",
            f"native code crashed with {name}",
            "run the replay command to see it again; the log has a stack",
        )
    return "error", f"it ended with exit code {returncode} and no result", "read the log, then run the replay command"


def _mib_under(folder: Path) -> int:
    written = 0
    for path in folder.rglob("*"):
        with suppress(OSError):
            written += path.lstat().st_size
    return round(written / 2**20)


def log_tail(log: Path) -> str:
    """Return the last lines of a log, readable whatever bytes native code wrote."""
    try:
        return "\n".join(log.read_text(errors="replace").splitlines()[-_LOG_LINES:])
    except FileNotFoundError:
        return ""
