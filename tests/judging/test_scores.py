"""Scores: exact answers are the best there are, and worse answers are worse by each of them."""

from dataclasses import replace

import numpy as np
import pytest

from aug3d_core.heads.head import Head, View
from aug3d_core.judging.config import EvaluationConfig
from aug3d_core.judging.conventions import BEST_DB
from aug3d_core.judging.panels import photograph
from aug3d_core.judging.scores import SCORES, evaluate
from tests.toy_scene import toy_scene


def test_an_exact_answer_is_the_best():
    picture = np.random.default_rng(0).integers(0, 256, (24, 32, 3), np.uint8)
    assert {name: score(picture, picture) for name, score in SCORES.items()} == {
        "psnr": BEST_DB,
        "ssim": pytest.approx(1),
        "flip": 0,
    }


def test_more_noise_is_worse_by_every_score():
    rng = np.random.default_rng(0)
    truth = np.full((24, 32, 3), 128, np.uint8)
    some, more = ((truth + rng.normal(0, spread, truth.shape)).clip(0, 255).astype(np.uint8) for spread in (4, 20))
    assert SCORES["psnr"](truth, some) > SCORES["psnr"](truth, more)
    assert SCORES["ssim"](truth, some) > SCORES["ssim"](truth, more)
    assert 0 < SCORES["flip"](truth, some) < SCORES["flip"](truth, more) < 1


def test_what_is_masked_counts_in_no_score_whatever_stands_there():
    rng = np.random.default_rng(0)
    truth = rng.integers(0, 256, (24, 32, 3), np.uint8)
    answer = (truth + rng.normal(0, 12, truth.shape)).clip(0, 255).astype(np.uint8)
    used = np.ones((24, 32), bool)
    used[5:17, 8:30] = False
    other, another = truth.copy(), answer.copy()
    other[~used], another[~used] = 0, rng.integers(0, 256, ((~used).sum(), 3))
    for name, score in SCORES.items():
        assert score(truth, answer, used) == score(other, another, used), name
        assert score(truth, answer) != score(other, another), f"{name}: or there is nothing to leave out"
    assert SCORES["psnr"](truth, answer, used) == pytest.approx(
        10 * np.log10(255**2 / np.mean((truth[used].astype(float) - answer[used]) ** 2))
    )


def test_a_mask_that_masks_nothing_changes_nothing():
    rng = np.random.default_rng(0)
    truth = rng.integers(0, 256, (24, 32, 3), np.uint8)
    answer = (truth + rng.normal(0, 12, truth.shape)).clip(0, 255).astype(np.uint8)
    for name, score in SCORES.items():
        assert score(truth, answer, np.ones((24, 32), bool)) == pytest.approx(score(truth, answer), rel=1e-6), name


def test_a_sliver_at_the_rim_is_scored_too():
    picture = np.random.default_rng(0).integers(0, 256, (24, 32, 3), np.uint8)
    used = np.zeros((24, 32), bool)
    used[0] = True
    assert SCORES["ssim"](picture, picture, used) == pytest.approx(1)


class Grey(Head):
    """Answers with one colour."""

    def loss(self, scenes, groups, noise):
        raise NotImplementedError

    def predict(self, scene, target, inputs):
        return View(np.full((scene.height_px, scene.width_px, 3), 99, np.uint8))


def masked(seed):
    """Return a scene with a part of its first target masked, in which anything stands."""
    scene = toy_scene(0, 24, 16)
    target = int(scene.groups["test"][0, 0])
    alpha, images = scene.alpha.copy(), scene.images.copy()
    alpha[target, 4:10, 6:20] = 0
    images[target, 4:10, 6:20] = np.random.default_rng(seed).integers(0, 256, (6, 14, 3))
    return replace(scene, alpha=alpha, images=images)


def test_every_answer_is_judged_by_what_is_used_of_a_target_and_its_share_is_told():
    config = EvaluationConfig(input_views=3)
    plain, one, two = (evaluate(Grey(), scene, config) for scene in (toy_scene(0, 24, 16), masked(0), masked(1)))
    assert one.equals(two)
    assert one["masked_share"].tolist() == [pytest.approx(84 / 384)] + [0] * (len(one) - 1)
    scores = [name for name in plain if name.endswith(("psnr", "ssim", "flip"))]
    exact = plain[scores].iloc[0].isin([BEST_DB, 1.0, 0.0])
    assert (one[scores].iloc[0] != plain[scores].iloc[0])[~exact].all()
    assert one["ssim"][0] == pytest.approx(plain["ssim"][0], abs=0.1), "a mask alone makes no answer alike"
    assert one[scores].iloc[1:].equals(plain[scores].iloc[1:])
    assert "masked_share" not in plain


def test_what_is_masked_is_hatched_in_pictures():
    scene, other = masked(0), masked(1)
    target, used = int(scene.groups["test"][0, 0]), scene.used(int(scene.groups["test"][0, 0]))
    shown = photograph(scene, target)
    np.testing.assert_array_equal(shown, photograph(other, target))
    np.testing.assert_array_equal(shown[used], scene.images[target][used])
    assert {*np.unique(shown[~used])} == {90, 150}
    np.testing.assert_array_equal(photograph(scene, target + 1), scene.images[target + 1])
