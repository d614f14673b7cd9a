import numpy as np
import pytest

from aug3d_core.rendering.quality import figures, reasons

HEIGHT, WIDTH = 6, 9


def stripes(low: int, high: int) -> np.ndarray:
    grey = np.where(np.arange(WIDTH) % 2, high, low)
    return np.broadcast_to(grey[None, :, None], (HEIGHT, WIDTH, 3)).astype(np.uint8)


def told(rgb: np.ndarray, alpha: np.ndarray) -> dict[str, float]:
    return {name: float(values[0]) for name, values in figures(rgb[None], alpha[None]).items()}


def test_figures_of_stripes_are_known():
    found = told(stripes(100, 120)[:, :8], np.full((HEIGHT, 8), 255, np.uint8))
    assert found["covered_share"] == 1.0
    assert found["mean_luminance"] == pytest.approx(110.0)
    assert found["contrast"] == pytest.approx(10.0)
    across, down = HEIGHT * 7, (HEIGHT - 1) * 8
    assert found["sharpness"] == pytest.approx(20 * across / (across + down))


def test_what_is_not_covered_does_not_count():
    alpha = np.full((HEIGHT, WIDTH), 255, np.uint8)
    alpha[:, :4] = 0
    rgb = stripes(100, 120).copy()
    seen = told(rgb, alpha)
    rgb[:, :4] = 255
    assert told(rgb, alpha) == seen
    assert seen["covered_share"] == pytest.approx(5 / 9)


def test_smearing_lowers_sharpness():
    rng = np.random.default_rng(0)
    rgb = rng.integers(0, 256, (HEIGHT, WIDTH, 3)).astype(np.uint8)
    smeared = np.repeat(rgb[:, ::3], 3, axis=1)[:, :WIDTH]
    alpha = np.full((HEIGHT, WIDTH), 255, np.uint8)
    assert told(smeared, alpha)["sharpness"] < 0.8 * told(rgb, alpha)["sharpness"]


def test_an_empty_view_has_figures_and_a_reason():
    found = figures(np.zeros((1, HEIGHT, WIDTH, 3), np.uint8), np.zeros((1, HEIGHT, WIDTH), np.uint8))
    assert all(np.isfinite(values).all() for values in found.values())
    assert reasons(found, 0.4).tolist() == ["too little surface"]


def test_reasons_come_in_order_and_good_views_have_none():
    rgb = np.stack([stripes(100, 120), stripes(0, 4), stripes(80, 82), stripes(100, 120)])
    alpha = np.full(rgb.shape[:3], 255, np.uint8)
    alpha[3, :4] = 0
    assert reasons(figures(rgb, alpha), 0.5).tolist() == ["", "black", "flat", "too little surface"]
