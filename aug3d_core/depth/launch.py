"""Run depth jobs in processes of their own, side by side, and wait for them."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor

from aug3d_core.depth.job import DepthJob
from aug3d_core.run.helper_process import ONE_THREAD, run_worker


def run_jobs(jobs: list[DepthJob], on_photo: Callable[[], None]) -> list[list[str]]:
    """Run the jobs at the same time; return for each what its photographs reported, in the order of its tasks.

    `on_photo` is called after each photograph, from several threads. Raises WorkerDied with the last lines that a worker
    logged, or OSError when the disk is full.
    """
    with ThreadPoolExecutor(max(1, len(jobs))) as pool:
        return list(pool.map(lambda job: _run(job, on_photo), jobs))


def _run(job: DepthJob, on_photo: Callable[[], None]) -> list[str]:
    reported = []

    def report(line: str) -> None:
        reported.append(line)
        on_photo()

    run_worker("aug3d_core.depth.worker", job, report, "a depth worker", "lower depth.max_px", ONE_THREAD)
    return reported
