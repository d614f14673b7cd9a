"""Run render jobs in worker processes and wait for them."""

from __future__ import annotations

import shutil
import threading
import time
import zipfile
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path

from aug3d_core.rendering.job import RenderJob, Shard, ViewDone
from aug3d_core.run.helper_process import WorkerDied, run_worker

_LIGHTER = "render a mesh with fewer triangles, or smaller views"


@dataclass
class Spent:
    """The cost of a job, over all its workers."""

    views: int = 0
    worker_s: float = 0.0  # sum of their wall times
    cycles_s: float = 0.0  # of which in Cycles' tracing
    growth_mib: float = 0.0  # largest growth of a worker after its first view

    @property
    def overhead_share(self) -> float | None:
        """Share of the workers' time that was not spent in Cycles: start, import, scene, files; None without a worker."""
        return 1 - self.cycles_s / self.worker_s if self.worker_s else None


def render(job: RenderJob, on_view: Callable[[int], None], workers: int = 1) -> Spent:
    """Render the shards of a job that do not exist yet; `on_view(done)` is called after each view, from several threads.

    Shards are divided among `workers` processes. A process that has grown too far ends early, and another one continues.
    Raises WorkerDied with the last log lines of a worker, or OSError when the disk is full.
    """
    missing = _missing(job.shards)
    tally = _Tally(on_view)
    with ThreadPoolExecutor(max(1, workers)) as pool:
        list(pool.map(lambda share: _finish(job, share, tally), [missing[i::workers] for i in range(workers)]))
    return tally.spent


def drop_leftovers(shards: Sequence[Shard]) -> None:
    """Delete shards that a power cut left incomplete, to be rendered again, and all that killed workers left beside them."""
    for left in {*shards[0].out.parent.iterdir()} - {shard.out for shard in shards}:
        shutil.rmtree(left) if left.is_dir() else left.unlink()
    for shard in shards:
        if shard.out.exists() and not _whole(shard.out):
            shard.out.unlink()


def _whole(file: Path) -> bool:
    try:
        with zipfile.ZipFile(file) as arrays:
            return arrays.testzip() is None  # reads every array and compares its checksum
    except zipfile.BadZipFile:
        return False


def _finish(job: RenderJob, share: Sequence[Shard], tally: _Tally) -> None:
    while share:
        name = f"the render worker of {share[0].out.name}"
        start = time.monotonic()
        worker = tally.worker()
        run_worker(
            "aug3d_core.rendering.worker", job.model_copy(update={"shards": tuple(share)}), worker, name, _LIGHTER
        )
        tally.ended(time.monotonic() - start)
        left = _missing(share)
        if len(left) == len(share):
            raise WorkerDied(f"{name} ended without its shard", "Run again; the shards already rendered are kept.")
        share = left


def _missing(shards: Sequence[Shard]) -> list[Shard]:
    return [shard for shard in shards if not shard.out.exists()]


class _Tally:
    """Counts what several workers report."""

    def __init__(self, on_view: Callable[[int], None]) -> None:
        self.spent = Spent()
        self._on_view = on_view
        self._lock = threading.Lock()

    def worker(self) -> Callable[[str], None]:
        """Return the function that receives one worker's reports."""
        at_first: list[float] = []

        def report(line: str) -> None:
            view = ViewDone.model_validate_json(line)
            at_first.append(view.resident_mib)
            with self._lock:
                self.spent.views += 1
                self.spent.cycles_s += view.cycles_s
                self.spent.growth_mib = max(self.spent.growth_mib, view.resident_mib - at_first[0])
                self._on_view(self.spent.views)

        return report

    def ended(self, seconds: float) -> None:
        """Count a worker that ended without an error."""
        with self._lock:
            self.spent.worker_s += seconds
