"""A mesh beside a photo: how alike they are, and how alike one colour would be."""

from __future__ import annotations

import numpy as np
import pytest

from aug3d_core.surface.checks import COVERED, Comparison


def compared(render: np.ndarray, alpha: int = 255) -> Comparison:
    photo = np.random.default_rng(0).integers(0, 256, (7, 11, 3), dtype=np.uint8)
    return Comparison(photo, render, np.full((7, 11), alpha, np.uint8), np.ones((7, 11), bool))


def test_one_colour_is_as_good_as_the_photo_varies() -> None:
    found = compared(np.zeros((7, 11, 3), np.uint8))
    spread = np.mean((found.photo - found.photo.reshape(-1, 3).mean(axis=0)) ** 2) / 255**2
    assert found.flat_psnr == pytest.approx(-10 * np.log10(spread))
    assert found.psnr < found.flat_psnr, "black shows less than the mean colour does"


def test_a_right_render_beats_one_colour() -> None:
    photo = compared(np.zeros((7, 11, 3), np.uint8)).photo
    assert compared(photo).psnr == 100 > compared(photo).flat_psnr + 50


def test_what_is_not_covered_is_not_judged() -> None:
    bare = compared(np.zeros((7, 11, 3), np.uint8), alpha=COVERED - 1)
    assert np.isnan(bare.psnr) and np.isnan(bare.flat_psnr)


def test_what_is_masked_is_not_judged() -> None:
    found = compared(np.zeros((7, 11, 3), np.uint8))
    used = np.ones((7, 11), bool)
    used[:, 6:] = False
    photo, alpha = found.photo.copy(), found.alpha.copy()
    photo[~used], alpha[~used] = 255, 0
    some, other = (
        Comparison(pixels, found.render, cover, used) for pixels, cover in ((found.photo, found.alpha), (photo, alpha))
    )
    assert (some.psnr, some.flat_psnr, some.covered_share) == (other.psnr, other.flat_psnr, 1.0)
    assert some.psnr != found.psnr
    assert other.covered_share == 1
    assert np.isnan(Comparison(photo, found.render, alpha, np.zeros((7, 11), bool)).covered_share)
