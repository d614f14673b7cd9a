"""Work in a process of its own: started with a job, followed line by line, buried with its last words.

A stage starts one (`run_worker`) where an engine must not share its process, or where only a process's end gives memory
back. The worker is a module with a `main` that begins with `begin`; reports are lines of text on its standard output.
"""

from __future__ import annotations

import errno
import os
import signal
import subprocess
import sys
import tempfile
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TypeVar

from aug3d_core.run.errors import Aug3dError
from aug3d_core.run.linux_process import SUPERVISED, die_with_parent
from aug3d_core.run.stage import Frozen

# `environment` of a worker of one thread: the libraries of engines and of NumPy read these when they are loaded
ONE_THREAD = {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
_TAIL_LINES = 20
Job = TypeVar("Job", bound=Frozen)


class WorkerDied(Aug3dError):
    """A worker process ended before its work was done. cause: killed or crash, which are tried again, or error."""

    def __init__(self, problem: str, remedy: str, cause: str = "error") -> None:
        super().__init__(problem, remedy)
        self.cause = cause


def run_worker(
    module: str,
    job: Frozen,
    on_report: Callable[[str], None],
    name: str,
    lighter: str,
    environment: Mapping[str, str] | None = None,
) -> None:
    """Run `python -m module job.json` and wait for it; `on_report(line)` is called with each line that it reports.

    `name` says in errors which worker it was, `lighter` what to do if its memory ran out; `environment` is set beside this
    process's own. The worker stays in this process's group, so that whoever kills the stage kills it too. Raises WorkerDied
    with the last lines that it logged, or OSError when the disk is full.
    """
    with tempfile.TemporaryDirectory() as folder:
        job_file, log_file = Path(folder) / "job.json", Path(folder) / "log.txt"
        job_file.write_text(job.model_dump_json())
        with log_file.open("wb") as log:
            command = [sys.executable, "-m", module, str(job_file)]
            own = {**os.environ, **(environment or {})}
            with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=log, text=True, env=own) as worker:
                for line in worker.stdout or ():
                    on_report(line.rstrip("\n"))
        if worker.returncode:
            tail = log_file.read_text(errors="replace").splitlines()[-_TAIL_LINES:]
            if any(os.strerror(errno.ENOSPC) in line for line in tail):
                raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), name)
            code = worker.returncode
            raise WorkerDied(_obituary(name, code, tail), _remedy(code, lighter), _cause(code))


def begin(kind: type[Job]) -> tuple[Job, Callable[[str], None]]:
    """Return, in a worker, the job named on the command line and the function that reports a line.

    From here on, whatever else is printed goes to the log: engines print to standard output as they like.
    """
    if SUPERVISED in os.environ:
        die_with_parent()
    job = kind.model_validate_json(Path(sys.argv[1]).read_text())
    reports = os.fdopen(os.dup(sys.stdout.fileno()), "w")
    os.dup2(sys.stderr.fileno(), sys.stdout.fileno())
    return job, lambda line: print(line, file=reports, flush=True)


def _cause(code: int) -> str:
    if code == -signal.SIGKILL:
        return "killed"
    return "crash" if code < 0 else "error"


def _obituary(name: str, code: int, tail: list[str]) -> str:
    how = f"signal {signal.Signals(-code).name}" if code < 0 else f"exit code {code}"
    return "\n".join([f"{name} ended with {how}; it last said:", *tail])


def _remedy(code: int, lighter: str) -> str:
    if code == -signal.SIGKILL:
        return f"It was killed, mostly for memory: {lighter}."
    return f"Read the lines above; if memory ran out, {lighter}."
