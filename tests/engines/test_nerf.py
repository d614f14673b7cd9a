import json
from itertools import pairwise

import numpy as np
import pandas as pd
import pytest
import torch
from safetensors.torch import load_file
from toy_scene import toy_scene

from aug3d_core.dataset.writer import write
from aug3d_core.errors import InputError
from aug3d_core.nerf import evaluation_stage, training_stage
from aug3d_core.nerf.checkpoint import STATE, load_model, load_state, save_model, save_state
from aug3d_core.nerf.config import EvaluationConfig, TrainingConfig
from aug3d_core.nerf.evaluation import CHEAP, bootstrap, psnr, ssim
from aug3d_core.nerf.model import PixelNeRF
from aug3d_core.nerf.training import Run, rate, take_step, train
from aug3d_core.store import layout

CONFIG = TrainingConfig(
    steps=12, hidden=16, encoder_channels=4, coarse_samples=6, fine_samples=4, depth_samples=2, rays_per_group=48,
    warmup_steps=4, checkpoint_every=5, learning_rate=3e-3,
)  # fmt: skip
JUDGE = EvaluationConfig(resamples=100, panels=2)


def silent(done: int, total: int, what: str) -> None:
    """Take no notice."""


@pytest.fixture(scope="module")
def scene():
    return toy_scene(0, 24, 16)


@pytest.fixture(scope="module")
def dataset(scene, tmp_path_factory):
    folder = tmp_path_factory.mktemp("dataset")
    write(scene, folder / layout.SCENE_ZARR, shard_views=64)
    return folder


@pytest.fixture(scope="module")
def trained(dataset, tmp_path_factory):
    out = tmp_path_factory.mktemp("training")
    return out, training_stage.run({"dataset": dataset}, CONFIG, out, silent)


def test_training_reports_its_curve_and_leaves_a_model(trained):
    out, outcome = trained
    assert outcome.metrics["steps"] == 12
    assert outcome.metrics["parameters"] == sum(w.numel() for w in load_file(out / layout.MODEL_WEIGHTS).values())
    assert [step for step, _ in outcome.series["train_psnr"]] == list(range(1, 13))
    assert len(pd.read_parquet(out / layout.CURVE)) == 12
    assert not (out / layout.CHECKPOINT).exists()


def test_training_repeats_to_the_bit(dataset, trained, tmp_path):
    training_stage.run({"dataset": dataset}, CONFIG, tmp_path, silent)
    for name in (layout.MODEL_WEIGHTS, layout.MODEL_CONFIG, layout.CURVE):
        assert (tmp_path / name).read_bytes() == (trained[0] / name).read_bytes()


def test_a_killed_training_resumes_to_the_same_curve_and_weights(scene, dataset, trained, tmp_path):
    def stop(run):
        if len(run.losses) == 8:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        train(scene, CONFIG, tmp_path / layout.CHECKPOINT, stop)
    assert len(load_state(tmp_path / layout.CHECKPOINT)["losses"]) == 5
    training_stage.run({"dataset": dataset}, CONFIG, tmp_path, silent)
    for name in (layout.MODEL_WEIGHTS, layout.CURVE):
        assert (tmp_path / name).read_bytes() == (trained[0] / name).read_bytes()


def test_another_seed_is_another_model(dataset, trained, tmp_path):
    training_stage.run({"dataset": dataset}, CONFIG.model_copy(update={"seed": 1, "steps": 2}), tmp_path, silent)
    assert (tmp_path / layout.MODEL_WEIGHTS).read_bytes() != (trained[0] / layout.MODEL_WEIGHTS).read_bytes()


def test_a_network_gone_to_nan_ends_training(scene):
    model = PixelNeRF(CONFIG)
    with torch.no_grad():
        model.fine.leave.weight.fill_(float("nan"))
        model.coarse.leave.weight.fill_(float("nan"))
    run = Run(model, torch.optim.Adam(model.parameters()))
    with pytest.raises(InputError, match="the loss at step 0 is nan"):
        take_step(run, scene, CONFIG, 0)


def test_the_rate_warms_up_and_falls():
    rates = [rate(CONFIG, step) for step in range(12)]
    assert rates[:4] == pytest.approx([3e-3 * (n + 1) / 4 for n in range(4)])
    assert all(a >= b for a, b in pairwise(rates[4:]))
    assert rate(CONFIG, 12) == pytest.approx(3e-3 * CONFIG.final_rate_share)


def test_evaluation_scores_every_test_view_beside_the_cheap_answers(scene, dataset, trained, tmp_path):
    outcome = evaluation_stage.run({"dataset": dataset, "training": trained[0]}, JUDGE, tmp_path, silent)
    table = pd.read_parquet(tmp_path / layout.TEST_VIEWS)
    assert table["photo_id"].tolist() == scene.photo_id[scene.groups["test"][:, 0]].tolist()
    figures = outcome.metrics
    assert figures["test_psnr_mean"] == pytest.approx(table["psnr"].mean(), abs=1e-3)
    assert figures["test_psnr_ci_low"] <= figures["test_psnr_mean"] <= figures["test_psnr_ci_high"]
    assert figures["group_low"] <= figures["group_average"] <= figures["group_best"]
    assert all(f"cheap_{name}" in figures for name in CHEAP)
    assert figures["cheap_mesh_render"] == 100.0  # the toy's mesh render is the truth
    assert all((tmp_path / path).is_file() for path in outcome.pictures.values())
    assert any("does not beat mesh render" in note for note in outcome.notes)


def test_evaluation_repeats_to_the_byte(dataset, trained, tmp_path):
    for name in ("one", "two"):
        (tmp_path / name).mkdir()
        evaluation_stage.run({"dataset": dataset, "training": trained[0]}, JUDGE, tmp_path / name, silent)
    for one in (path for path in (tmp_path / "one").rglob("*") if path.is_file()):
        assert one.read_bytes() == (tmp_path / "two" / one.relative_to(tmp_path / "one")).read_bytes()


def test_more_inputs_than_a_test_group_has_are_refused(dataset, trained, tmp_path):
    config = JUDGE.model_copy(update={"input_views": 6})
    with pytest.raises(InputError, match="input_views = 6, but a test group has 5 support views"):
        evaluation_stage.run({"dataset": dataset, "training": trained[0]}, config, tmp_path, silent)


def test_a_model_comes_back_as_it_was(tmp_path):
    model = PixelNeRF(CONFIG)
    save_model(model, tmp_path)
    again = load_model(tmp_path)
    assert again.config == CONFIG
    assert all(torch.equal(a, b) for a, b in zip(model.parameters(), again.parameters(), strict=True))


def test_weights_of_another_network_are_refused(tmp_path):
    save_model(PixelNeRF(CONFIG), tmp_path)
    other = {"config": CONFIG.model_copy(update={"hidden": 32}).model_dump(mode="json")}
    (tmp_path / layout.MODEL_CONFIG).write_text(json.dumps(other))
    with pytest.raises(InputError, match="another network"):
        load_model(tmp_path)


@pytest.mark.parametrize("name", [layout.MODEL_WEIGHTS, layout.MODEL_CONFIG])
def test_a_truncated_model_is_refused(tmp_path, name):
    save_model(PixelNeRF(CONFIG), tmp_path)
    (tmp_path / name).write_bytes((tmp_path / name).read_bytes()[:100])
    with pytest.raises(InputError, match="damaged"):
        load_model(tmp_path)


@pytest.mark.parametrize("name", [layout.MODEL_WEIGHTS, layout.MODEL_CONFIG])
def test_a_missing_model_is_refused(tmp_path, name):
    save_model(PixelNeRF(CONFIG), tmp_path)
    (tmp_path / name).unlink()
    with pytest.raises(InputError, match=name):
        load_model(tmp_path)


@pytest.mark.parametrize("size", [0, 200, -50])
def test_a_corrupt_checkpoint_is_refused(scene, tmp_path, size):
    save_state(tmp_path, {"losses": [1.0] * 100, "weights": torch.rand(100)})
    (tmp_path / STATE).write_bytes((tmp_path / STATE).read_bytes()[:size])
    with pytest.raises(InputError, match=r"checkpoint state\.pt is damaged"):
        train(scene, CONFIG, tmp_path)


class Bomb:
    """What a hostile checkpoint could hold: code that runs when it is unpickled."""

    def __reduce__(self):
        return print, ("boom",)


def test_a_checkpoint_with_code_is_refused_without_running_it(scene, tmp_path, capsys):
    save_state(tmp_path, {"losses": Bomb()})
    with pytest.raises(InputError, match=r"checkpoint state\.pt is damaged"):
        train(scene, CONFIG, tmp_path)
    assert "boom" not in capsys.readouterr().out


def test_a_checkpoint_of_another_configuration_is_refused(scene, tmp_path):
    save_state(tmp_path, {"config": CONFIG.model_copy(update={"hidden": 32}).model_dump(mode="json")})
    with pytest.raises(InputError, match="another configuration"):
        train(scene, CONFIG, tmp_path)


def test_scores_of_known_errors():
    truth = np.full((16, 16, 3), 100, np.uint8)
    assert psnr(truth, truth) == 100.0
    assert psnr(truth, truth + np.uint8(10)) == pytest.approx(20 * np.log10(255 / 10))
    assert ssim(truth, truth) == pytest.approx(1.0)


def test_the_interval_narrows_with_the_groups():
    rng = np.random.default_rng(0)
    few, many = rng.normal(20, 2, 5), rng.normal(20, 2, 500)
    widths = [high - low for low, high in (bootstrap(v, 500, np.random.default_rng(1)) for v in (few, many))]
    assert widths[1] < widths[0] / 3
