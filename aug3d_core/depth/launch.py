"""Run depth jobs in processes of their own, side by side, and wait for them."""

from __future__ import annotations

import subprocess
import sys
import tempfile
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

from aug3d_core.depth.job import DepthJob
from aug3d_core.errors import Aug3dError

_TAIL_LINES = 20


class WorkerDied(Aug3dError):
    """A depth process ended before its share was done."""


def run_jobs(jobs: list[DepthJob], on_photo: Callable[[], None]) -> list[list[float]]:
    """Run the jobs at the same time; return for each what its photographs reported.

    `on_photo` is called after each photograph, from several threads. The workers stay in this process's group, so that whoever
    kills the stage kills them too. Raises WorkerDied with the last lines that a worker logged.
    """
    with ThreadPoolExecutor(max(1, len(jobs))) as pool:
        return list(pool.map(lambda job: _run(job, on_photo), jobs))


def _run(job: DepthJob, on_photo: Callable[[], None]) -> list[float]:
    reported = []
    with tempfile.TemporaryDirectory() as folder:
        job_file, log_file = Path(folder) / "job.json", Path(folder) / "log.txt"
        job_file.write_text(job.model_dump_json())
        with log_file.open("wb") as log:
            command = [sys.executable, "-m", "aug3d_core.depth.worker", str(job_file)]
            with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=log, text=True) as worker:
                for line in worker.stdout or ():
                    reported.append(float(line.split()[1]))
                    on_photo()
        if worker.returncode:
            tail = log_file.read_text(errors="replace").splitlines()[-_TAIL_LINES:]
            how = f"a depth worker ended with code {worker.returncode}; it last said:"
            raise WorkerDied("\n".join([how, *tail]), "Read the lines above; a lower depth.max_px needs less memory.")
    return reported
