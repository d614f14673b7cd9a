"""Engines under test share the machine with other work, as stages do in `run/process.py`; and what tests share."""

import fcntl
import os
import shutil
from pathlib import Path

import pytest

from aug3d_core.dataset.files import SCENE_ZARR
from aug3d_core.dataset.writer import write
from aug3d_core.run.files import OUTCOME
from aug3d_core.run.process import QUIET_THREADS
from tests.toy_scene import toy_scene

for name, value in QUIET_THREADS.items():
    os.environ.setdefault(name, value)  # before torch loads OpenMP


@pytest.fixture(scope="session")
def little_flight(tmp_path_factory: pytest.TempPathFactory, worker_id: str) -> Path:
    """Return a folder with a flight: `in`, `photos`, `sfm_matching` and `sfm`. One process makes it for all; only read it."""
    from tests.engines.sfm_runs import fly

    mine = tmp_path_factory.getbasetemp()
    folder = (mine if worker_id == "master" else mine.parent) / "little_flight"
    with folder.with_suffix(".lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        if not (folder / "sfm" / OUTCOME).exists():
            shutil.rmtree(folder, ignore_errors=True)
            fly(folder)
    return folder


@pytest.fixture(scope="module")
def scene():
    return toy_scene(0, 24, 16)


@pytest.fixture(scope="module")
def dataset(scene, tmp_path_factory):
    folder = tmp_path_factory.mktemp("dataset")
    write(scene, folder / SCENE_ZARR, shard_views=64)
    return folder


@pytest.fixture(scope="module")
def trained(dataset, tmp_path_factory):
    from aug3d_core.training import stage as training_stage  # torch, which most engines do without
    from tests.engines.toy_training import CONFIG, silent

    out = tmp_path_factory.mktemp("training")
    return out, training_stage.run({"dataset": dataset}, CONFIG, out, silent)
