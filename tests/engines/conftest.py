"""Engines under test share the machine with other work, as stages do in `isolation.py`; and what tests of training share."""

import os

import pytest

from aug3d_core.dataset.files import SCENE_ZARR
from aug3d_core.dataset.writer import write
from aug3d_core.run.process import QUIET_THREADS
from tests.toy_scene import toy_scene

for name, value in QUIET_THREADS.items():
    os.environ.setdefault(name, value)  # before torch loads OpenMP


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
