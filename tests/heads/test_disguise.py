from dataclasses import replace

import pytest
import torch

from aug3d_core.heads.sweep.config import SweepConfig
from aug3d_core.heads.sweep.disguise import PLAIN, Camera, Disguise

OTHERS = SweepConfig(recoloured_share=0.0, other_cameras_share=1.0)
USUAL = Camera(gain=1.0, blur_px=0.0, noise=0.0)


def pictures(count: int = 2, height: int = 24, width: int = 32, seed: int = 0) -> torch.Tensor:
    return torch.rand((count, height, width, 3), generator=torch.Generator().manual_seed(seed))


def drawn(config: SweepConfig, seed: int = 0, inputs: int = 2) -> Disguise:
    return Disguise.drawn(config, inputs, torch.Generator().manual_seed(seed))


def test_where_nothing_is_drawn_all_is_seen_as_it_is():
    seen = pictures()
    assert Disguise.drawn(OTHERS, 2, None) == PLAIN
    for plain in (PLAIN, drawn(SweepConfig(recoloured_share=0.0))):
        assert torch.equal(plain.of_inputs(seen), seen)
        assert torch.equal(plain.of_target(seen[0]), seen[0])


def test_a_share_of_the_steps_is_disguised():
    for field in ("recoloured_share", "other_cameras_share"):
        config = SweepConfig(**{"recoloured_share": 0.0, "other_cameras_share": 0.0, field: 0.3})
        plain = sum(drawn(config, seed) == PLAIN for seed in range(300))
        # Of the orders of three colours and the two signs, one in twelve changes nothing
        assert 170 < plain < 260


@pytest.mark.parametrize("seed", range(6))
def test_other_colours_are_those_of_the_target_and_of_every_input(seed: int):
    seen = pictures()
    disguise = drawn(SweepConfig(recoloured_share=1.0), seed)
    shown = disguise.of_inputs(seen)
    for one, was in zip(shown, seen, strict=True):
        assert torch.equal(disguise.of_target(was), one)
        back = (1 - one if disguise.negative else one)[..., torch.tensor(disguise.order).argsort()]
        assert torch.allclose(back, was)


@pytest.mark.parametrize("seed", range(6))
def test_inputs_that_have_no_faults_of_their_own_are_seen_as_the_target_is(seed: int):
    seen = pictures()
    disguise = replace(drawn(OTHERS, seed), cameras=(USUAL, USUAL))
    for one, was in zip(disguise.of_inputs(seen), seen, strict=True):
        assert torch.allclose(one, disguise.of_target(was), atol=1e-6)


def test_each_input_has_a_camera_of_its_own_and_the_target_none_of_them():
    seen = pictures(1, 48, 64).expand(3, -1, -1, -1)
    disguise = drawn(OTHERS, 3, inputs=3)
    assert len(set(disguise.cameras)) == 3
    shown = disguise.of_inputs(seen)
    assert (shown[0] - shown[1]).abs().mean() > 1e-3
    other = replace(disguise, cameras=disguise.cameras[::-1])
    assert torch.equal(other.of_target(seen[0]), disguise.of_target(seen[0]))


def test_colours_stay_between_black_and_white():
    for seed in range(20):
        shown = drawn(OTHERS, seed).of_inputs(pictures(), finer=2)
        assert shown.min() >= 0 and shown.max() <= 1
        assert shown.isfinite().all()


def test_contrast_and_tint_are_those_of_the_equation():
    disguise = replace(PLAIN, gamma=2.0, tint=(1.0, 0.5, 3.0), cameras=(USUAL,))
    assert torch.allclose(disguise.of_target(torch.full((4, 4, 3), 0.5)), torch.tensor([0.25, 0.125, 0.75]))


@pytest.mark.parametrize("finer", [1, 2])
def test_blur_has_the_spread_that_it_says_and_leaves_even_colours(finer: int):
    point = torch.zeros((1, 33, 33, 3))
    point[0, 16, 16] = 1.0
    away = torch.arange(33) - 16.0
    of_all = replace(PLAIN, blur_px=1.5, cameras=(USUAL,))
    of_one = replace(PLAIN, cameras=(replace(USUAL, blur_px=1.5),))
    for disguise in (of_all, of_one):
        shown = disguise.of_inputs(point, finer)[0, ..., 0]
        for axis in (0, 1):
            assert (shown.sum(dim=axis) * away**2).sum().sqrt() == pytest.approx(1.5 * finer, rel=0.05)
        even = torch.full((1, 9, 9, 3), 0.4)
        assert torch.allclose(disguise.of_inputs(even, finer), even)


def test_noise_is_as_strong_as_it_says_and_new_in_every_picture():
    grey = torch.full((2, 64, 64, 3), 0.5)
    noisy = Camera(gain=1.0, blur_px=0.0, noise=0.02)
    disguise = replace(PLAIN, cameras=(noisy, noisy), noise=torch.Generator().manual_seed(0))
    first, second = disguise.of_inputs(grey) - grey
    assert first.std() == pytest.approx(0.02, rel=0.05)
    assert abs((first * second).mean()) < 0.1 * 0.02**2
    assert (disguise.of_inputs(grey, finer=2) - grey).std() == pytest.approx(0.02 * 2**0.5, rel=0.05)


def test_the_seed_decides():
    seen = pictures()
    assert torch.equal(drawn(OTHERS, 5).of_inputs(seen), drawn(OTHERS, 5).of_inputs(seen))
    assert not torch.equal(drawn(OTHERS, 5).of_inputs(seen), drawn(OTHERS, 6).of_inputs(seen))
