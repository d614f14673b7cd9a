"""Overlays lie over the prediction where they should, and the rest of it stays."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from PIL import Image

from aug3d_core.judging.panels import depth_colours
from aug3d_core.view.pictures import COLOUR, DEPTH, OVERLAYS, UNSEEN, Predicted, enlarged, overlaid, photograph

COLOURS = np.random.default_rng(0).integers(0, 255, (7, 11, 3), dtype=np.uint8)
SEEN = np.arange(77).reshape(7, 11) > 30
VIEW = Predicted(COLOURS, np.linspace(5, 9, 77).reshape(7, 11), SEEN, (1,), False, 0.1)


def test_what_no_input_sees_is_marked_alone() -> None:
    changed = (overlaid(VIEW, UNSEEN) != COLOURS).any(axis=2)
    assert changed.any() and not changed[SEEN].any()


def test_depth_changes_everything_to_its_colours_and_leaves_the_view_to_be_seen() -> None:
    over = overlaid(VIEW, DEPTH).astype(float)
    assert (over != COLOURS).any(axis=2).mean() > 0.9
    off_depth, off_view = (
        np.abs(over - one).mean() for one in (depth_colours(np.linspace(5, 9, 77).reshape(7, 11)), COLOURS)
    )
    assert 0 < off_depth < off_view


def test_a_head_that_tells_neither_has_its_colours() -> None:
    bare = Predicted(COLOURS, None, None, (1,), False, 0.1)
    assert all(np.array_equal(overlaid(bare, overlay), COLOURS) for overlay in OVERLAYS)
    assert np.array_equal(overlaid(VIEW, COLOUR), COLOURS)


def test_it_keeps_its_shape_when_it_is_enlarged() -> None:
    assert enlarged(COLOURS).shape == (326, 512, 3)


def test_a_photograph_is_made_small(tmp_path: Path) -> None:
    Image.new("RGB", (1280, 960), (200, 10, 10)).save(tmp_path / "a.png")
    small = photograph(tmp_path / "a.png")
    assert small.shape == (480, 640, 3) and tuple(small[0, 0]) == (200, 10, 10)
