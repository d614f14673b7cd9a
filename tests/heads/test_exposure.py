"""Every group is shown at one brightness and contrast, and comes back as it was."""

from __future__ import annotations

import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st

from aug3d_core.heads.exposure import Exposure


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
