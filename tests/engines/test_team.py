import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st

from aug3d_core.dataset.batches import Wanted, draw
from aug3d_core.heads.sweep.config import SweepConfig
from aug3d_core.training import loop as training
from aug3d_core.training.checkpoint import saved_steps
from aug3d_core.training.config import TrainingConfig
from aug3d_core.training.ddp import Team, fitting_size, gathered
from tests.engines.toy_training import changed
from tests.toy_scene import toy_scene

CONFIG = changed(
    steps=8, groups_per_step=2, hidden=8, encoder_channels=4, coarse_samples=4, fine_samples=2, depth_samples=0,
    rays_per_group=16, warmup_steps=0, checkpoint_every=4,
)  # fmt: skip


def train_without_noise(team, scene, folder):
    """Train with samples in the middle of their parts, for each member draws noise of its own."""
    training.noise_of = lambda seeds: None
    return training.train([scene], CONFIG, folder, team=team)


def train_as_it_is(team, scene, config, folder):
    return training.train([scene], config, folder, team=team)


def test_two_processes_with_a_group_each_come_to_the_weights_of_one_with_two(tmp_path, monkeypatch):
    monkeypatch.setattr(training, "noise_of", training.noise_of)  # so that it is set back
    scene = toy_scene(0, 12, 8)
    alone = train_without_noise(Team(), scene, tmp_path / "alone")
    with gathered(2, train_without_noise, scene, tmp_path / "together") as team:
        assert (team.rank, team.size) == (0, 2)
        together = train_without_noise(team, scene, tmp_path / "together")
    for one, other in zip(alone.head.parameters(), together.head.parameters(), strict=True):
        assert torch.allclose(one, other, atol=1e-6)
    assert [step["loss"] for step in together.history] == pytest.approx(
        [step["loss"] for step in alone.history], rel=1e-5
    )
    assert [probe.psnr for probe in together.probes] == pytest.approx([probe.psnr for probe in alone.probes], rel=1e-5)
    assert saved_steps(tmp_path / "together") == [4, 8]


def test_a_head_that_leaves_parts_of_itself_out_of_a_step_is_trained_by_two(tmp_path):
    """The plane sweep does not search a scaffold's heights where it has one, which each member draws for itself."""
    head = SweepConfig(planes=8, features=8, crop_px=32, start="random")
    config = TrainingConfig(head=head, steps=8, groups_per_step=2, warmup_steps=0)
    scene = toy_scene(0, 48, 36)
    with gathered(2, train_as_it_is, scene, config, tmp_path) as team:
        trained = train_as_it_is(team, scene, config, tmp_path)
    assert np.isfinite([step["loss"] for step in trained.history]).all() and len(trained.history) == 8


def test_members_share_out_the_groups_of_a_step():
    groups = draw([toy_scene(0, 12, 8)], Wanted(4, 3, 0.5, 16), np.random.default_rng(0))
    assert [Team(rank, 2).share(groups) for rank in range(2)] == [(groups[0], groups[2]), (groups[1], groups[3])]
    assert Team().share(groups) == groups


@given(st.integers(1, 64), st.integers(0, 16))
def test_members_have_equally_many_groups(groups, devices):
    size = fitting_size(groups, devices)
    assert groups % size == 0
    assert 1 <= size <= max(devices, 1)
    assert fitting_size(4, 3) == 2
