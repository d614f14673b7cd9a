"""How a depth worker is started."""

from __future__ import annotations

from pathlib import Path

import pytest

from aug3d_core.depth import launch
from aug3d_core.depth.job import DepthJob

SAYS_ITS_THREADS = """
import os
from aug3d_core.depth.job import DepthJob
from aug3d_core.run.helper_process import begin

_, report = begin(DepthJob)
os.sched_setaffinity(0, range(os.cpu_count()))
import numpy
from threadpoolctl import threadpool_info
report(str(max(library["num_threads"] for library in threadpool_info())))
"""


def test_a_worker_keeps_to_one_thread(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """As many as there are cores work side by side: threads of each would wait for each other."""
    (tmp_path / "test_depth_threads.py").write_text(SAYS_ITS_THREADS)
    monkeypatch.setenv("PYTHONPATH", str(tmp_path))
    run_worker = launch.run_worker
    monkeypatch.setattr(launch, "run_worker", lambda _, *given: run_worker("test_depth_threads", *given))
    job = DepthJob(
        step="sweep", views=tmp_path, images=tmp_path, masks=tmp_path, raw=tmp_path, workspace=tmp_path, max_px=96,
        plane_step_px=2.0, tasks=(),
    )  # fmt: skip
    assert launch.run_jobs([job], lambda: None) == [["1"]]
