"""Right photographs agree at the points, other photographs do not, however exposed."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from PIL import Image

from aug3d_core.sfm.agreement import detail_agreement


def pictures(folder: Path, changes: dict[int, int]) -> list[Path]:
    """Write six pictures of one texture, each shifted by 5 px more; `changes` shows another texture in some."""
    files = []
    for index in range(6):
        rng = np.random.default_rng(changes.get(index, 0))
        coarse = Image.fromarray(rng.integers(0, 256, (60, 60), dtype=np.uint8))
        texture = np.asarray(coarse.resize((300, 300), Image.Resampling.BICUBIC), float)
        shifted = texture[:200, 5 * index : 5 * index + 200]
        files.append(folder / f"{index}.png")
        Image.fromarray((shifted * (1 - 0.1 * index) + 10 * index).clip(0, 255).astype(np.uint8)).save(files[-1])
    return files


def observations() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    rng = np.random.default_rng(7)
    at = rng.uniform([40, 10], [190, 190], size=(150, 2))
    view, point = np.repeat(np.arange(6), 150), np.tile(np.arange(150), 6)
    return view, point, at[point] - np.column_stack([5 * view, np.zeros(len(view))])


def test_one_texture_seen_from_six_places_at_six_exposures(tmp_path: Path) -> None:
    assert (detail_agreement(pictures(tmp_path, {}), *observations()) > 0.95).all()


def test_other_photographs_under_the_same_names(tmp_path: Path) -> None:
    agreement = detail_agreement(pictures(tmp_path, {i: i + 1 for i in range(6)}), *observations())
    assert (np.abs(agreement) < 0.3).all()


def test_one_other_photograph_is_told_from_the_rest(tmp_path: Path) -> None:
    agreement = detail_agreement(pictures(tmp_path, {2: 9}), *observations())
    assert abs(agreement[2]) < 0.3
    assert (np.delete(agreement, 2) > 0.7).all()


def test_too_few_shared_points_tell_nothing(tmp_path: Path) -> None:
    view, point, xy = observations()
    agreement = detail_agreement(pictures(tmp_path, {}), view, point + 1000 * view, xy)
    assert np.isnan(agreement).all()
