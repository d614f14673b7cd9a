"""A head is a folder and nothing else: one that is put beside PixelNeRF is chosen, trained, judged and shown by its name."""

from __future__ import annotations

import json
import shutil
import subprocess
import sys
import textwrap
from pathlib import Path

import pytest

import aug3d_core
from aug3d_core.dataset.files import SCENE_ZARR
from aug3d_core.dataset.writer import write
from tests.toy_scene import toy_scene

CONFIG = """
    from typing import ClassVar, Literal

    from aug3d_core.heads.config import HeadConfig


    class MeanConfig(HeadConfig):
        title: ClassVar[str] = "Mean of the inputs"
        name: Literal["mean"] = "mean"
        start: float = 0.5


    CONFIG = MeanConfig
    TRAINED = {"steps": 30, "warmup_steps": 0, "learning_rate": 0.1, "least_gain_db": 0}
    PRESETS = {name: {**TRAINED, "head": MeanConfig()} for name in ("tiny", "small", "paper")}
"""
HEAD = """
    import numpy as np
    import torch
    from torch import nn

    from aug3d_core.heads.head import Head, View, colour_measures, to_8_bit


    class MeanHead(Head):
        def __init__(self, config):
            super().__init__()
            self.config, self.share = config, nn.Parameter(torch.tensor(config.start))

        def forward(self, images):
            return self.share * images.mean(dim=(0, 1, 2))

        def loss(self, scenes, groups, noise):
            colours, truths = [], []
            for group in groups:
                assert group.pixels is None, "whole images"
                images = torch.from_numpy(scenes[group.scene].images[group.inputs] / 255.0).float()
                truth = torch.from_numpy(scenes[group.scene].images[group.targets] / 255.0).float().reshape(-1, 3)
                colours.append(self(images).expand_as(truth))
                truths.append(truth)
            weight = torch.full((len(groups), len(truths[0]), 1), 1 / len(truths[0]))
            measured = colour_measures(torch.stack(colours), torch.stack(truths), weight)
            return measured["error"], {**measured, "share": self.share}

        @torch.inference_mode()
        def predict(self, scene, target, inputs):
            colour = self(torch.from_numpy(scene.images[inputs] / 255.0).float())
            return View(np.broadcast_to(to_8_bit(colour.numpy()), scene.images[target].shape))


    HEAD = MeanHead
"""
RUN = """
    import json, sys
    from pathlib import Path

    from aug3d_core.factory.config import SceneConfig, scene_config
    from aug3d_core.judging import stage as judging
    from aug3d_core.novel import stage as novel
    from aug3d_core.novel.config import PredictionConfig
    from aug3d_core.training import stage as training

    data, out = map(Path, sys.argv[1:])
    silent = lambda done, total, what: None
    config = scene_config("tiny", ["training.head=mean", "training.head.start=0.25", "evaluation.panels=1"])
    trained = training.run({"dataset": data}, config.training, out, silent)
    inputs = {"dataset": data, "training": out}
    judged = judging.run(inputs, config.evaluation, out, silent)
    shown = novel.run(inputs, PredictionConfig(), out, silent)
    schema = SceneConfig.model_json_schema()["$defs"]["TrainingConfig"]["properties"]["head"]["anyOf"]
    told = {"steps": config.training.steps, "forms": [one["$ref"].rpartition("/")[2] for one in schema]}
    told |= {"trained": trained.metrics, "judged": judged.metrics, "shown": shown.metrics}
    print(json.dumps(told))
"""


@pytest.fixture(scope="module")
def told(tmp_path_factory: pytest.TempPathFactory) -> dict:
    """Put a second head beside the first in a copy of the sources; run it, and return what it reported."""
    folder = tmp_path_factory.mktemp("second_head")
    core = shutil.copytree(Path(aug3d_core.__file__).parent, folder / "aug3d_core")
    (core / "heads" / "mean").mkdir()
    for name, text in {"__init__": "", "config": CONFIG, "head": HEAD}.items():
        (core / "heads" / "mean" / f"{name}.py").write_text(textwrap.dedent(text))
    (folder / "out").mkdir()
    write(toy_scene(0, 24, 16), folder / SCENE_ZARR, shard_views=64)
    words = [sys.executable, "-c", textwrap.dedent(RUN), str(folder), str(folder / "out")]
    done = subprocess.run(words, capture_output=True, text=True, cwd=folder, env={"PYTHONPATH": str(folder)})
    assert done.returncode == 0, done.stderr[-3000:]
    return json.loads(done.stdout)


def test_it_brings_its_own_training_settings(told: dict) -> None:
    assert told["steps"] == told["trained"]["steps"] == 30


def test_the_form_offers_both(told: dict) -> None:
    assert told["forms"] == ["MeanConfig", "PixelNerfConfig", "SweepConfig"]


def test_it_learns(told: dict) -> None:
    assert told["trained"]["head"] == "mean"
    assert told["trained"]["parameters"] == 1
    assert abs(told["judged"]["test_psnr_mean"] - told["judged"]["cheap_mean_colour"]) < 1.5, "it began 6 dB below"


def test_without_depth_there_are_figures_of_colour_alone(told: dict) -> None:
    assert told["judged"]["head"] == told["shown"]["head"] == "mean"
    assert "coarse_psnr_mean" not in told["judged"] and "depth_near" not in told["shown"]
