"""Run a render job in a process of its own and wait for it."""

from __future__ import annotations

import errno
import os
import signal
import subprocess
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path

from aug3d_core.errors import Aug3dError
from aug3d_core.rendering.job import RenderJob

_TAIL_LINES = 20


class WorkerDied(Aug3dError):
    """The render process ended without its shard."""


def render(job: RenderJob, on_view: Callable[[int], None]) -> None:
    """Render a job's shard; `on_view(done)` is called after each view.

    The worker stays in this process's group, so that whoever kills the stage kills it too. Raises WorkerDied with the
    last lines that it logged, or OSError when the disk is full.
    """
    with tempfile.TemporaryDirectory() as folder:
        job_file, log_file = Path(folder) / "job.json", Path(folder) / "log.txt"
        job_file.write_text(job.model_dump_json())
        with log_file.open("wb") as log:
            command = [sys.executable, "-m", "aug3d_core.rendering.worker", str(job_file)]
            with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=log, text=True) as worker:
                for line in worker.stdout or ():
                    on_view(int(line.split()[1]))
        if worker.returncode or not job.out.exists():
            tail = log_file.read_text(errors="replace").splitlines()[-_TAIL_LINES:]
            if any(os.strerror(errno.ENOSPC) in line for line in tail):
                raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), str(job.out))
            raise WorkerDied(_obituary(job, worker.returncode, tail), _remedy(worker.returncode))


def _obituary(job: RenderJob, code: int, tail: list[str]) -> str:
    how = f"signal {signal.Signals(-code).name}" if code < 0 else f"exit code {code}"
    return "\n".join([f"the render worker of {job.out.name} ended with {how}; it last said:", *tail])


def _remedy(code: int) -> str:
    if code == -signal.SIGKILL:
        return "It was killed, mostly for memory: render a mesh with fewer triangles, or smaller views."
    return "Read the lines above; the shards already rendered are kept, so running again continues from here."
