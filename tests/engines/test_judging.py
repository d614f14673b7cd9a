import json

import numpy as np
import pandas as pd
import pytest
import torch

from aug3d_core.heads.files import MODEL_CONFIG, MODEL_WEIGHTS
from aug3d_core.heads.head import build
from aug3d_core.heads.saved import load, save
from aug3d_core.judging import stage as evaluation_stage
from aug3d_core.judging.config import EvaluationConfig
from aug3d_core.judging.files import TEST_VIEWS
from aug3d_core.judging.scores import psnr, ssim
from aug3d_core.judging.summary import CHEAP
from aug3d_core.run.errors import InputError
from tests.engines.toy_training import CONFIG, HEAD, silent
from tests.same_files import assert_same_files

JUDGE = EvaluationConfig(panels=2)


def test_evaluation_scores_every_test_view_beside_the_cheap_answers(scene, dataset, trained, tmp_path):
    outcome = evaluation_stage.run({"dataset": dataset, "training": trained[0]}, JUDGE, tmp_path, silent)
    table = pd.read_parquet(tmp_path / TEST_VIEWS)
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
    assert_same_files(tmp_path / "one", tmp_path / "two")


def test_a_test_group_with_fewer_views_than_asked_for_gives_all_and_says_so(dataset, trained, tmp_path):
    config = JUDGE.model_copy(update={"input_views": 6})
    judged = evaluation_stage.run({"dataset": dataset, "training": trained[0]}, config, tmp_path, silent)
    assert judged.notes[0] == "a test group has 5 support views: every answer was given 5, not 6"
    assert {len(row.split()) for row in pd.read_parquet(tmp_path / TEST_VIEWS)["inputs"]} == {5}


def test_a_model_comes_back_as_it_was(tmp_path):
    model = build(HEAD)
    save(model, tmp_path)
    again = load(tmp_path)
    assert again.config == HEAD
    assert all(torch.equal(a, b) for a, b in zip(model.parameters(), again.parameters(), strict=True))


def test_weights_of_another_network_are_refused(tmp_path):
    save(build(HEAD), tmp_path)
    other = {"head": HEAD.model_copy(update={"hidden": 32}).model_dump(mode="json")}
    (tmp_path / MODEL_CONFIG).write_text(json.dumps(other))
    with pytest.raises(InputError, match="another network"):
        load(tmp_path)


def test_a_model_from_before_a_difference_had_a_name_is_refused(tmp_path):
    """Filled in by a default, it would be another network that predicts nonsense."""
    save(build(HEAD), tmp_path)
    told = {"head": HEAD.model_dump(mode="json", exclude={"even_exposure"})}
    (tmp_path / MODEL_CONFIG).write_text(json.dumps(told))
    with pytest.raises(InputError, match=r"before there was even_exposure.*\n.*train"):
        load(tmp_path)


def test_a_model_of_up_to_0_6_is_read(tmp_path):
    """Its settings stood among those of training, and its head had no name."""
    save(build(HEAD), tmp_path)
    flat = CONFIG.model_dump(mode="json", exclude={"head"}) | HEAD.model_dump(mode="json", exclude={"name"})
    (tmp_path / MODEL_CONFIG).write_text(json.dumps({"config": flat}))
    assert load(tmp_path).config == HEAD


def test_a_model_of_an_unknown_head_is_refused(tmp_path):
    save(build(HEAD), tmp_path)
    (tmp_path / MODEL_CONFIG).write_text(json.dumps({"head": {"name": "../../evil"}}))
    with pytest.raises(InputError, match="there is no head"):
        load(tmp_path)


@pytest.mark.parametrize("name", [MODEL_WEIGHTS, MODEL_CONFIG])
def test_a_truncated_model_is_refused(tmp_path, name):
    save(build(HEAD), tmp_path)
    (tmp_path / name).write_bytes((tmp_path / name).read_bytes()[:100])
    with pytest.raises(InputError, match="damaged"):
        load(tmp_path)


@pytest.mark.parametrize("name", [MODEL_WEIGHTS, MODEL_CONFIG])
def test_a_missing_model_is_refused(tmp_path, name):
    save(build(HEAD), tmp_path)
    (tmp_path / name).unlink()
    with pytest.raises(InputError, match=name):
        load(tmp_path)


def test_scores_of_known_errors():
    truth = np.full((16, 16, 3), 100, np.uint8)
    assert psnr(truth, truth) == 100.0
    assert psnr(truth, truth + np.uint8(10)) == pytest.approx(20 * np.log10(255 / 10))
    assert ssim(truth, truth) == pytest.approx(1.0)
