"""Scores: exact answers are the best there are, and worse answers are worse by each of them."""

import numpy as np
import pytest

from aug3d_core.judging.conventions import BEST_DB
from aug3d_core.judging.scores import SCORES


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
