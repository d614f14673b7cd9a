import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from aug3d_core.dataset.slab import Slab, slab_of

SLOPES = st.floats(-0.2, 0.2)


def scene_points(a: float, b: float, c: float) -> np.ndarray:
    """Ground points on a plane, a third as many on roofs 5 to 20 above it."""
    rng = np.random.default_rng(0)
    xy = rng.uniform(-100, 100, (4000, 2))
    height = np.where(np.arange(4000) % 4 == 0, rng.uniform(5, 20, 4000), rng.normal(0, 0.1, 4000))
    return np.column_stack([xy, xy @ [a, b] + c + height])


@given(a=SLOPES, b=SLOPES, c=st.floats(-500, 500))
def test_the_ground_is_found_under_roofs_and_the_slab_holds_both(a, b, c):
    slab = slab_of(scene_points(a, b, c), outlier_share=0.005, margin_share=0.1)
    assert (slab.a, slab.b) == pytest.approx((a, b), abs=2e-3)
    assert slab.c == pytest.approx(c, abs=0.2)
    assert -3.5 < slab.low < -0.2
    assert 19 < slab.high < 23


@given(st.integers(0, 1000))
def test_rays_enter_at_the_top_and_leave_at_the_bottom(seed):
    rng = np.random.default_rng(seed)
    slab = Slab(0.1, -0.05, 3.0, -1.0, 9.0)
    origins = rng.uniform([-20, -20, 40], [20, 20, 80], (50, 3))
    directions = rng.uniform([-0.6, -0.6, -1], [0.6, 0.6, -0.5], (50, 3))
    near, far = slab.span(origins, directions, np.full(50, 1e-3), np.full(50, 1e6))
    assert slab.height(origins + near[:, None] * directions) == pytest.approx(np.full(50, 9.0), abs=1e-6)
    assert slab.height(origins + far[:, None] * directions) == pytest.approx(np.full(50, -1.0), abs=1e-6)


def test_a_ray_that_misses_the_slab_keeps_the_bounds_given():
    slab = Slab(0.0, 0.0, 0.0, -1.0, 9.0)
    origins, up = np.array([[0.0, 0.0, 50.0]]), np.array([[0.0, 0.1, 1.0]])
    assert slab.span(origins, up, np.array([2.0]), np.array([70.0])) == (np.array([2.0]), np.array([70.0]))
    assert np.isinf(slab.meet(origins, up, 0.0)).all()


def test_a_ray_from_inside_the_slab_starts_at_once():
    slab = Slab(0.0, 0.0, 0.0, -1.0, 9.0)
    near, far = slab.span(np.array([[0.0, 0, 4]]), np.array([[0.0, 0, -1]]), np.array([0.5]), np.array([100.0]))
    assert (near[0], far[0]) == (0.5, 5.0)
