"""Errors on test photographs lie on the ground that those show."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from PIL import Image

from aug3d_core.advice.model_error import error_at
from aug3d_core.geometry.masks import save_mask
from tests.advice.flown_site import site, views


def compared(folder: Path, photo: int, off: int) -> None:
    """Write a photograph at the size of its prediction, and a prediction that is so many grey levels off."""
    (folder / "compared").mkdir(parents=True, exist_ok=True)
    true = np.full((192, 256, 3), 100, np.uint8)
    Image.fromarray(true).save(folder / "compared" / f"{photo:06d}.png")
    Image.fromarray(true + np.uint8(off)).save(folder / "compared" / f"predicted_{photo:06d}.png")


def test_where_the_model_errs_counts_more_and_where_nothing_is_known_as_usual(tmp_path: Path) -> None:
    compared(tmp_path / "a", 12, 4)  # at (-60, -60)
    compared(tmp_path / "b", 108, 120)  # at (60, 60): of another fold
    place = site()
    error = error_at(place, views(), [tmp_path / "a", tmp_path / "b", tmp_path / "none"])
    near = {at: np.abs(place.samples.xyz[:, :2] - at).max(axis=1) < 10 for at in (-60.0, 0.0, 60.0)}
    assert (error[near[-60.0]] == 0.5).all() and (error[near[0.0]] == 1).all() and (error[near[60.0]] > 1.2).all()


def test_without_a_test_all_places_are_alike(tmp_path: Path) -> None:
    assert (error_at(site(), views(), [tmp_path]) == 1).all()


def test_what_is_masked_says_nothing_of_the_model(tmp_path: Path) -> None:
    """One of two test photographs is masked where it shows what the other does not."""
    for folder, masked in (("plain", False), ("masked", True)):
        compared(tmp_path / folder, 12, 4)
        compared(tmp_path / folder, 108, 120)
        if masked:
            used = np.ones((192, 256), bool)
            used[:, 10:] = False
            save_mask(used, tmp_path / folder / "compared" / "mask_000108.png")
    place = site()
    plain, masked = (error_at(place, views(), [tmp_path / folder]) for folder in ("plain", "masked"))
    middle = np.abs(place.samples.xyz[:, :2] - 60.0).max(axis=1) < 5
    assert (plain[middle] > 1.2).all()
    assert (masked[middle] == 1).all(), "as where nothing is known"
