"""The map and the verdict tell only of ground that views were asked for of."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from aug3d_core.advice import choice, page
from aug3d_core.advice.choice import Advised, Choice, chosen
from aug3d_core.advice.page import advice_page, verdict
from aug3d_core.advice.plan import Plan
from tests.advice.flown_site import mesh, site, views

ONE = Advised(1, (0.0, 0.0, 72.0), 0.0, -90.0, 0.1, 0.5, 0.0, 1.0)


def told(missing: np.ndarray, *advised: Advised) -> Plan:
    """Return a plan by what is missing of each sample of the site."""
    made = Choice(advised, (0.3,) * (len(advised) + 1), missing, missing)
    return Plan(site(), views(), made, "m", None)


def half() -> np.ndarray:
    """Return samples of which the western half was looked at: a quarter of that is poor."""
    east, north = site().samples.xyz[:, :2].T
    return np.where(east > 0, np.nan, np.where(north > np.quantile(north[east <= 0], 0.75), 0.9, 0.1))


@pytest.mark.parametrize("advised", [(), (ONE,)])
def test_the_verdict_is_of_what_was_looked_at_and_says_how_much_that_is(advised: tuple[Advised, ...]) -> None:
    missing = half()
    share = np.isfinite(missing).mean()
    said = verdict(told(missing, *advised))
    assert said.endswith(f" {share:.0%} of the site was looked at.") and 0.4 < share < 0.6
    assert not advised or said.startswith("25% of what was looked at is poorly photographed")
    whole = verdict(told(np.nan_to_num(missing, nan=0.1), *advised))
    assert "looked at" not in whole


def test_a_place_that_was_not_looked_at_has_no_colour(monkeypatch: pytest.MonkeyPatch) -> None:
    drawn = list[np.ndarray]()
    monkeypatch.setattr(page, "cells", lambda frame, low, cell, rgba: drawn.append(rgba) or "")
    shown = advice_page("toy", told(half(), ONE), mesh(), [])
    area = site().area
    coloured = drawn[0][..., 3] > 0
    east = area.middle(np.ones_like(area.wanted))[:, 0].reshape(area.wanted.shape)
    assert (coloured == area.wanted)[east < 0].all(), "cells between samples have the colour of their neighbour"
    assert not coloured[east > 3 * area.cell].any() and area.wanted[east > 3 * area.cell].any()
    assert "not looked at" in shown
    assert "not looked at" not in advice_page("toy", told(np.zeros(len(half())), ONE), mesh(), [])


def test_of_a_large_site_not_all_is_looked_at(monkeypatch: pytest.MonkeyPatch) -> None:
    place, error = site(50.0), np.ones(len(site(50.0).samples.xyz))
    whole = chosen(place, views(50.0), error, 1, lambda *_: None)
    monkeypatch.setattr(choice, "_MOST_PLACES", 12)
    part = chosen(place, views(50.0), error, 1, lambda *_: None)
    assert whole.looked_at > 0.9 and 0.05 < part.looked_at < 0.6
    assert "of the site was looked at" in verdict(replace(told(part.before, ONE), site=place))
    known = np.isfinite(part.before)
    assert part.advised[0].poor == pytest.approx(1.0, abs=0.2) and np.median(part.before[known]) > 0.75
