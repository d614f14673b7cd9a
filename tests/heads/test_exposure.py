"""Every group is shown at one brightness and contrast, and comes back as it was."""

from __future__ import annotations

import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st

from aug3d_core.heads.exposure import Exposure, gains


def group(seed: int) -> tuple[torch.Tensor, torch.Tensor]:
    """Draw two groups of three views, a third of whose pixels show nothing."""
    noise = torch.Generator().manual_seed(seed)
    rgb = torch.rand((2, 3, 6, 5, 3), generator=noise)
    return rgb, (torch.rand((2, 3, 6, 5, 1), generator=noise) > 0.33).float()


@given(st.integers(0, 99), st.floats(0.1, 1.0), st.floats(0.0, 0.3))
def test_gain_and_haze_change_nothing_that_is_shown(seed: int, gain: float, haze: float) -> None:
    rgb, alpha = group(seed)
    other = rgb * gain + haze
    shown, again = (Exposure.of(one, alpha).even(one) for one in (rgb, other))
    assert torch.allclose(shown, again, atol=1e-4)
    exposure = Exposure.of(other, alpha)
    assert torch.allclose(exposure.restore(again), other.clamp(0, 1), atol=1e-5)
    seen = (alpha > 0).expand_as(shown[..., :3])
    for one, where in zip(shown, seen, strict=True):
        assert one[where].mean().item() == pytest.approx(0.5, abs=1e-4)
        assert one[where].std(correction=0).item() == pytest.approx(0.25, abs=1e-4)


def test_what_shows_nothing_counts_for_nothing() -> None:
    rgb, alpha = group(0)
    spoilt = torch.where(alpha > 0, rgb, torch.ones(()))
    assert torch.equal(Exposure.of(spoilt, alpha).mean, Exposure.of(rgb * alpha, alpha).mean)


@pytest.mark.parametrize("alpha", [0.0, 1.0])
def test_one_colour_and_nothing_at_all_stay_finite(alpha: float) -> None:
    rgb = torch.full((1, 2, 4, 4, 3), 0.7)
    exposure = Exposure.of(rgb, torch.full((1, 2, 4, 4, 1), alpha))
    assert torch.isfinite(exposure.even(rgb)).all()
    assert torch.allclose(exposure.restore(exposure.even(rgb)), rgb, atol=1e-5)


def exposed(factors, seed=0):
    """Return views of the same points, each with its own exposure, and that all see everything."""
    colours = 0.2 + 0.3 * torch.rand((1, 3, 20, 30), generator=torch.Generator().manual_seed(seed))
    views = colours * torch.tensor(factors)[:, None, None, None]
    return views, torch.ones(len(factors), 1, 20, 30)


def test_views_of_the_same_points_are_made_alike():
    views, seen = exposed([1.0, 1.4, 0.7])
    alike = views * gains(views, seen)[..., None, None]
    assert torch.allclose(alike[1], alike[0], rtol=0.01)
    assert torch.allclose(alike[2], alike[0], rtol=0.01)


def test_moving_things_change_no_exposure():
    views, seen = exposed([1.0, 1.2])
    views[1, :, 4:10, 5:20] = 0.9
    found = gains(views, seen)
    assert torch.allclose(found[0] / found[1], torch.full((3,), 1.2), rtol=0.01)


def test_a_view_that_shares_nothing_keeps_its_colours():
    views, seen = exposed([1.0, 1.5, 0.6])
    seen[2] = 0
    found = gains(views, seen)
    assert torch.allclose(found[2], torch.ones(3))
    assert torch.allclose(found[0] / found[1], torch.full((3,), 1.5), rtol=0.01)


def test_alone_or_in_the_dark_nothing_changes():
    views, seen = exposed([1.0])
    assert torch.equal(gains(views, seen), torch.ones(1, 3))
    assert torch.equal(gains(torch.zeros(2, 3, 20, 30), torch.ones(2, 1, 20, 30)), torch.ones(2, 3))
