"""Run stages as the factory starts them: each in a process of its own, forked from one that has imported the libraries."""

from __future__ import annotations

import json
import os
import signal
import time
from collections.abc import Callable, Iterable, Mapping
from multiprocessing.popen_fork import Popen
from pathlib import Path
from typing import Any

from aug3d_core.factory.stages import FROM_MODEL, FROM_PHOTOS, FROM_POSES
from aug3d_core.geometry.views import Points, Tracks, Views
from aug3d_core.run.files import EARLIER, ERROR, FILES, JOB, LOG, OUTCOME
from aug3d_core.run.fork_server import start
from aug3d_core.run.linux_process import SUPERVISED
from aug3d_core.run.process import log_tail
from aug3d_core.run.stage_main import Job
from tests.engines.little_scene import poses, write_flight


def take_photos(folder: Path, out: Path) -> Path:
    """Run the photos stage; return the folder that has its files. It loads OpenCV, which must not meet pycolmap in a test."""
    made = out.with_name(f"{out.name}_stage")
    outcome = run_stage("photos", made, {"folder": folder})
    assert "problem" not in outcome, outcome
    return (made / FILES).rename(out)


def run_stage(
    name: str, folder: Path, inputs: dict[str, Path], cpus: set[int] | None = None, assist: bool = False, **config: Any
) -> dict[str, Any]:
    """Run the stage of a name that reads these inputs; return its outcome, or its error. assist: only make its shards."""
    folder.mkdir(parents=True, exist_ok=True)
    process = _start(name, folder, inputs, config, assist)
    if cpus is not None:
        os.sched_setaffinity(process.pid, cpus)  # long before it has imported an engine, which counts them
    return _told(name, folder, process)


def run_stage_killed(
    name: str, folder: Path, inputs: dict[str, Path], moments: Iterable[Callable[[Path], bool]], **config: Any
) -> dict[str, Any]:
    """Run the stage, kill it as soon as `moment(its output)` is true, and go on with the next moment; then to its end."""
    folder.mkdir(parents=True)
    for moment in moments:
        process = _start(name, folder, inputs, config)
        while process.poll() is None and not moment(folder / FILES):
            time.sleep(0.01)
        assert process.poll() is None, f"{name} ended before it was killed:\n{log_tail(folder / LOG)}"
        os.kill(process.pid, signal.SIGKILL)
        process.wait()
    return _told(name, folder, _start(name, folder, inputs, config))


def _start(name: str, folder: Path, inputs: dict[str, Path], config: dict[str, Any], assist: bool = False) -> Popen:
    ways, read = (*FROM_PHOTOS, *FROM_POSES, *FROM_MODEL), set(inputs) - {EARLIER}
    stage = next(one for one in ways if one.name == name and set(one.inputs) == read)
    job = Job(stage=name, entry=stage.assist if assist else stage.entry, config=config, inputs=inputs)
    (folder / JOB).write_text(job.model_dump_json())
    return start(stage.package, folder / JOB, folder / LOG, {**os.environ, SUPERVISED: str(os.getpid())})


def _told(name: str, folder: Path, process: Popen) -> dict[str, Any]:
    ended = process.wait(timeout=300)
    for told in (OUTCOME, ERROR):
        if (folder / told).exists():
            return json.loads((folder / told).read_bytes())
    process.kill()
    raise AssertionError(f"{name} told nothing and ended with {ended}:\n{log_tail(folder / LOG)}")


def run_sfm(
    photos: Path,
    folder: Path,
    cpus: set[int] | None = None,
    sfm: Mapping[str, Any] | None = None,
    earlier: Path | None = None,
    **matching: int,
) -> dict[str, Any]:
    """Match in `<folder>_matching` and run the sfm stage; return the outcome or the first error of the two."""
    matches = folder.with_name(f"{folder.name}_matching")
    matched = run_stage("matching", matches, {"photos": photos}, cpus, **matching)
    if "problem" in matched:
        return matched
    inputs = {"photos": photos, "matching": matches / "files"} | ({"earlier": earlier} if earlier else {})
    return run_stage("sfm", folder, inputs, cpus, **(sfm or {}))


def fly(folder: Path) -> None:
    """Write twelve photographs with good GPS to `in`, take them in as `photos`, and reconstruct them as `sfm`."""
    photos = take_photos(write_flight(folder / "in", poses(), noise_m=0.2), folder / "photos")
    run_sfm(photos, folder / "sfm")


def outcome_of(folder: Path) -> dict[str, Any]:
    return json.loads((folder / OUTCOME).read_bytes())


def loaded(folder: Path) -> tuple[Views, Points, Tracks]:
    files = folder / "files"
    return Views.load(files / "views.npz"), Points.load(files / "points.npz"), Tracks.load(files / "tracks.npz")
