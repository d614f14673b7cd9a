"""What `aug3d bench gpu` measures, with the processor in the place of the GPU."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch

from aug3d_core.bench import gpu, gpu_job
from aug3d_core.bench.gpu_job import Steps, Views
from aug3d_core.dataset.files import SCENE_ZARR
from aug3d_core.dataset.writer import write
from aug3d_core.run.errors import InputError
from aug3d_core.store.store import Store
from aug3d_core.studies.common.trial import Measured
from aug3d_core.training.config import presets
from tests.toy_scene import toy_scene


@pytest.fixture(scope="module")
def packed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("packed")
    write(toy_scene(0, 48, 36), folder / SCENE_ZARR, 8)
    return folder


@pytest.mark.parametrize(("preset", "head"), [("tiny", "sweep"), ("paper", "sweep"), ("tiny", "pixelnerf")])
def test_steps_are_those_of_the_preset_and_each_is_timed(
    packed: Path, preset: str, head: str, monkeypatch: Any
) -> None:
    taken = []
    real = gpu_job.take_step

    def counted(run: Any, *rest: Any) -> None:
        real(run, *rest)
        taken.append(run)

    monkeypatch.setattr(gpu_job, "take_step", counted)
    monkeypatch.setattr(gpu_job, "_WARM", 1)
    found = gpu_job.steps_of(packed, preset, head, 1, "cpu", 1)
    assert found.seconds.shape == (1,) and found.seconds[0] > 0 and found.gpu_peak_mib == 0
    assert len(taken) == 2 and taken[-1].config.steps == presets(head)[preset].steps
    assert all(np.isfinite(step["loss"]) for step in taken[-1].history)


def test_views_are_those_of_the_shipped_weights_from_inputs_alone(packed: Path) -> None:
    views = gpu_job.views_of(packed, "cpu", 1)
    assert views.colours.shape == (len(views.seconds), 36, 48, 3) and (views.seconds > 0).all()
    assert np.array_equal(views.colours, gpu_job.views_of(packed, "cpu", 1).colours)


def test_the_same_steps_end_in_the_same_weights_where_sums_have_an_order(packed: Path) -> None:
    assert gpu_job.repeated(packed, "cpu") == 0.0


def test_ratios_are_medians_of_the_same_steps(monkeypatch: pytest.MonkeyPatch) -> None:
    seconds = {("cuda", 2): [1.0, 2.0, 4.0], ("cpu", 2): [12.0, 20.0, 44.0]}

    def timed(job: partial) -> Steps:
        return Steps(np.array(seconds.get(job.args[-2:], [5.0, 10.0, 20.0])), 7.0)

    monkeypatch.setattr(gpu, "in_own_process", timed)
    monkeypatch.setattr(gpu.os, "sched_getaffinity", lambda _: set(range(16)))
    found = gpu.training_figures(Path("data"), "small", 3)
    assert found["train_speedup_small_over_2_cores"].value == 11.0 and found["train_speedup_small_over_2_cores"].holds
    assert found["train_speedup_small_over_all_cores"].value == 5.0
    assert found["train_step_seconds_small"].value == 2.0 and found["train_gpu_peak_mib_small"].value == 7.0


def test_views_of_both_devices_are_compared_by_the_worst(monkeypatch: pytest.MonkeyPatch) -> None:
    off = np.zeros((3, 4, 4, 3), np.uint8)
    off[1] = 2

    def timed(job: partial) -> Views:
        device = job.args[1]
        return Views(np.array([0.01, 0.02, 0.04]), off if device == "cuda" else np.zeros_like(off))

    monkeypatch.setattr(gpu, "in_own_process", timed)
    found = gpu.view_figures(Path("data"), 512)
    assert found["views_per_second_512"].value == 50.0
    assert (
        found["views_alike_db_512"].value == pytest.approx(20 * np.log10(255 / 2))
        and not found["views_alike_db_512"].holds
    )


def test_without_a_gpu_it_says_what_to_look_at(tmp_path: Path) -> None:
    if torch.cuda.is_available():
        pytest.skip("this machine has a GPU")
    with pytest.raises(InputError, match="torch sees no CUDA GPU"):
        gpu.figures(Store(tmp_path), Measured("tiny"), lambda *said: None)
