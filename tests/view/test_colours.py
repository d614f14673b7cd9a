"""Cameras of one kind have one colour, of another kind another, and test views are red in all of them."""

from __future__ import annotations

import numpy as np
import pytest

from aug3d_core.view.colours import GROUP, REGISTRATION, ROLES, SPLIT, TARGET, colours_of

ROLE = ("train", "train", "support", "target", "gap", "")
GROUPS = np.array([0, 1, 1, 0, -1, -1])
ERRORS = np.array([0.5, 0.5, 1.0, 9.0, 0.4, np.nan])


@pytest.mark.parametrize("by", [GROUP, SPLIT, REGISTRATION])
def test_test_views_are_red_and_no_other_is(by: str) -> None:
    rgb = colours_of(by, ROLE, GROUPS, ERRORS)
    assert rgb.shape == (6, 3)
    assert [tuple(map(int, one)) == ROLES[TARGET] for one in rgb] == [role == TARGET for role in ROLE]


def test_a_group_has_its_colour() -> None:
    rgb = colours_of(GROUP, ("",) * 40, np.arange(40) % 20, np.ones(40))
    assert np.array_equal(rgb[:20], rgb[20:])
    assert len(np.unique(rgb[:20], axis=0)) == 20


def test_a_role_has_its_colour() -> None:
    rgb = colours_of(SPLIT, ROLE, GROUPS, ERRORS)
    assert np.array_equal(rgb[0], rgb[1]) and len(np.unique(rgb, axis=0)) == 4  # none is as grey as the gap


def test_the_worse_a_camera_was_placed_the_yellower_it_is() -> None:
    error_px = np.array([0.5, 0.5, 0.5, 0.6, 0.8, np.nan])
    red = colours_of(REGISTRATION, ("",) * 6, np.zeros(6, int), error_px)[:, 0].astype(int)
    assert red[0] < red[3] < red[4] < red[5]


def test_no_cameras_have_no_colours() -> None:
    assert colours_of(GROUP, (), np.zeros(0, int), np.zeros(0)).shape == (0, 3)
