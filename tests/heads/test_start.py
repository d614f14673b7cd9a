"""First weights of the plane sweep: those that are shipped belong to the code, and others are refused by name."""

from __future__ import annotations

import json

import numpy as np
import pytest
import torch
from safetensors.torch import save_file

from aug3d_core.heads import saved
from aug3d_core.heads.config import shipped
from aug3d_core.heads.files import MODEL_CONFIG, MODEL_WEIGHTS
from aug3d_core.heads.head import build
from aug3d_core.heads.sweep.config import PRESETS, TOWNS, SweepConfig
from aug3d_core.judging.cheap_answers import ground_homography
from aug3d_core.judging.scores import psnr
from aug3d_core.run.digest import file_digest
from aug3d_core.run.errors import InputError
from tests.toy_scene import toy_scene

MOST_BYTES = 2 * 2**20


def test_the_shipped_model_is_whole_small_and_of_this_code() -> None:
    folder, digest, _ = shipped()
    assert file_digest(folder / MODEL_WEIGHTS) == digest
    assert sum(file.stat().st_size for file in folder.iterdir()) < MOST_BYTES
    assert saved.load(folder).config.name == "sweep"


def test_it_predicts_a_world_it_never_saw_better_than_a_homography() -> None:
    folder, _, _ = shipped()
    scene, head = toy_scene(3, 128, 96), saved.load(folder)
    bare = scene.scaffold.copy()
    bare[:] = 0
    gained = []
    for target, *inputs in scene.groups["test"].tolist()[:4]:
        view, truth = head.predict(scene, target, np.array(inputs[:3])), scene.images[target]
        plain = ground_homography(scene, target, np.array(inputs[:3]))
        gained.append(psnr(truth, view.parts["inputs_alone"]) - psnr(truth, plain))
    assert np.mean(gained) > 1.0


@pytest.mark.parametrize("preset", [name for name, one in PRESETS.items() if one["head"].start == TOWNS])
def test_presets_that_start_from_it_can(preset: str) -> None:
    head = build(PRESETS[preset]["head"])
    before = {name: value.clone() for name, value in head.state_dict().items()}
    assert head.start().metrics == {"started_with": TOWNS}
    assert any(not torch.equal(before[name], value) for name, value in head.state_dict().items())


def test_a_model_saved_before_a_setting_is_refused_only_where_it_could_be_another_network(tmp_path) -> None:
    saved.save(build(SweepConfig(start="random")), tmp_path)
    told = json.loads((tmp_path / MODEL_CONFIG).read_text())
    for name in SweepConfig.of_training:
        del told["head"][name]
    (tmp_path / MODEL_CONFIG).write_text(json.dumps(told))
    assert saved.load(tmp_path).config == SweepConfig()
    del told["head"]["fine_planes"]
    (tmp_path / MODEL_CONFIG).write_text(json.dumps(told))
    with pytest.raises(InputError, match="before there was fine_planes"):
        saved.load(tmp_path)


def test_weights_of_a_file_are_taken(tmp_path) -> None:
    torch.manual_seed(1)
    other = build(SweepConfig(start="random"))
    saved.save(other, tmp_path)
    head = build(SweepConfig(start=str(tmp_path / MODEL_WEIGHTS)))
    assert head.start().metrics == {"started_with": MODEL_WEIGHTS}
    assert all(torch.equal(value, other.state_dict()[name]) for name, value in head.state_dict().items())


def test_a_network_that_they_do_not_fit_starts_at_random_and_says_so() -> None:
    start = build(SweepConfig(features=8)).start()
    assert start.metrics == {"started_with": "random"}
    assert "the shipped weights are of 16 features, not 8" in start.notes[0]


def moved_away(head):
    """Start a head, and move its weights as training would."""
    head.start()
    first = {name: value.detach().clone() for name, value in head.named_parameters()}
    with torch.no_grad():
        for value in head.parameters():
            value += 0.1
    return first


@pytest.mark.parametrize("share", [0.0, 0.25, 0.5])
@pytest.mark.parametrize("of_a_file", [False, True])
def test_the_finished_model_keeps_a_share_of_its_first_weights(tmp_path, share, of_a_file) -> None:
    saved.save(build(SweepConfig(start="random")), tmp_path)
    start = str(tmp_path / MODEL_WEIGHTS) if of_a_file else TOWNS
    head = build(SweepConfig(start=start, start_share=share))
    first = moved_away(head)
    head.finish()
    for name, value in head.named_parameters():
        torch.testing.assert_close(value, first[name] + 0.1 * (1 - share))


@pytest.mark.parametrize("config", [SweepConfig(start="random"), SweepConfig(features=8)])
def test_random_first_weights_are_not_kept(config) -> None:
    head = build(config)
    first = moved_away(head)
    head.finish()
    for name, value in head.named_parameters():
        assert torch.equal(value, first[name] + 0.1)


def damaged(path):
    path.write_bytes(b"not weights at all")


def of_another_head(path):
    save_file({"fine.leave.weight": torch.zeros(3)}, path)


def of_other_settings(path):
    save_file(build(SweepConfig(features=8)).state_dict(), path)


@pytest.mark.parametrize(
    ("made", "told"),
    [
        (lambda path: None, "there is no file"),
        (damaged, "is damaged"),
        (of_another_head, "is of another head"),
        (of_other_settings, "is of other settings"),
    ],
)
def test_weights_that_cannot_be_taken_are_refused_by_name(tmp_path, made, told) -> None:
    path = tmp_path / "weights.safetensors"
    made(path)
    with pytest.raises(InputError, match=told) as refused:
        build(SweepConfig(start=str(path))).start()
    assert str(path) in refused.value.problem
    assert "training.head.start=random" in refused.value.remedy
