"""A photograph that shows what the one before it shows is left out; one that shows anything else never is."""

from __future__ import annotations

import math
from collections.abc import Iterable
from pathlib import Path

import cv2
import numpy as np
import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from PIL import Image

from aug3d_core.photos.config import PhotosConfig
from aug3d_core.photos.files import read_photos
from aug3d_core.photos.redundant import image_motion
from aug3d_core.photos.stage import run
from aug3d_core.run.errors import InputError
from aug3d_core.run.stage import Outcome
from tests.photos.photo_files import pixels

WIDTH, HEIGHT = 256, 192
GROUND = np.asarray(pixels(3, (1200, 400)).convert("L"))  # what is flown over


def seen(x: int, y: int = 100) -> np.ndarray:
    """Return the picture from there."""
    return GROUND[y : y + HEIGHT, x : x + WIDTH]


def flown(folder: Path, xs: Iterable[int]) -> Path:
    """Write the photographs of a flight along x."""
    folder.mkdir()
    for number, x in enumerate(xs):
        Image.fromarray(seen(x)).convert("RGB").save(folder / f"{number:03}.png")
    return folder


def take_in(folder: Path, out: Path, least_motion: float) -> Outcome:
    out.mkdir()
    return run({"folder": folder}, PhotosConfig(least_motion=least_motion), out, lambda done, total, what: None)


@settings(max_examples=30)
@given(st.integers(-20, 20), st.integers(-20, 20))
def test_motion_is_the_way_that_the_picture_moves(along: int, across: int) -> None:
    moved = image_motion(seen(400), seen(400 + along, 100 + across))
    assert moved == pytest.approx(math.hypot(along, across) / WIDTH, abs=0.3 / WIDTH)


def test_neither_exposure_nor_noise_is_motion() -> None:
    noisy = seen(400) * 0.5 + np.random.default_rng(0).normal(0, 3, (HEIGHT, WIDTH))
    assert image_motion(seen(400), noisy.clip(0, 255).astype(np.uint8)) < 0.01


@pytest.mark.parametrize(
    "other",
    [
        seen(400 + WIDTH // 2),
        np.asarray(pixels(4, (WIDTH, HEIGHT)).convert("L")),
        np.full((HEIGHT, WIDTH), 90, np.uint8),
        seen(400)[:, : WIDTH - 8],
    ],
    ids=["half away", "another place", "nothing to see", "another camera"],
)
def test_what_cannot_be_followed_shows_something_else(other: np.ndarray) -> None:
    assert image_motion(seen(400), other) == math.inf
    assert image_motion(other, seen(400)) == math.inf


@pytest.mark.parametrize(("degrees", "zoom"), [(20.0, 1.0), (0.0, 1.3)])
def test_a_turn_and_a_descent_are_motion(degrees: float, zoom: float) -> None:
    turned = cv2.warpAffine(GROUND, cv2.getRotationMatrix2D((528, 196), degrees, zoom), GROUND.shape[::-1])
    assert image_motion(seen(400), turned[100 : 100 + HEIGHT, 400 : 400 + WIDTH]) > 0.05


def test_a_slow_flight_is_thinned_and_a_hovering_drone_counts_once(tmp_path: Path) -> None:
    outcome = take_in(flown(tmp_path / "in", [*range(0, 164, 4), *range(240, 700, 80)]), tmp_path / "out", 0.05)
    kept = [int(Path(name).stem) for name in read_photos(tmp_path / "out")["name"]]
    assert kept == [*range(0, 40, 4), *range(40, 47)], "16 px are more than 5 % of 256, 12 are not"
    rejected = pd.read_parquet(tmp_path / "out" / "rejected.parquet")
    assert len(rejected) == outcome.metrics["redundant"] == 30 and outcome.metrics["rejected"] == 0
    assert "redundant: shows what 000.png shows, 1.6% of its width aside" in rejected["reason"].tolist()
    assert outcome.state == "ok" and "30 photographs show what the one before them shows" in outcome.notes[0]
    assert len(list((tmp_path / "out" / "images").iterdir())) == len(kept)


def test_all_are_used_unless_asked_for(tmp_path: Path) -> None:
    outcome = take_in(flown(tmp_path / "in", range(0, 40, 4)), tmp_path / "out", 0.0)
    assert outcome.metrics["photos"] == 10 and outcome.metrics["redundant"] == 0


def test_a_drone_that_only_hovers_is_told(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"6 photographs show what 1 show") as refused:
        take_in(flown(tmp_path / "in", range(400, 406)), tmp_path / "out", 0.05)
    assert "photos.least_motion=0" in str(refused.value)
