"""A sheet of panels of views of any size can be read again."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from aug3d_core.dataset import contact
from aug3d_core.judging.panels import GAP_PX, LABEL_PX, SMALL_PX, grid, save
from aug3d_core.report.thumbnails import thumbnail_jpeg


def rows(width: int, height: int, grey: int = 200) -> list[list[tuple[str, np.ndarray]]]:
    picture = np.full((height, width, 3), grey, np.uint8)
    return [[("", picture)] * 8 for _ in range(24)]


def test_pictures_that_fit_are_on_the_sheet_as_they_are() -> None:
    picture = np.random.default_rng(0).integers(0, 256, (120, SMALL_PX, 3), dtype=np.uint8)
    sheet = grid([[("one", picture), ("other", picture)]])
    assert sheet.shape == (120 + LABEL_PX + GAP_PX, 2 * (SMALL_PX + GAP_PX), 3)
    np.testing.assert_array_equal(sheet[LABEL_PX : LABEL_PX + 120, :SMALL_PX], picture)


def test_small_pictures_are_shown_twice_as_large() -> None:
    picture = np.random.default_rng(0).integers(0, 256, (12, 16, 3), dtype=np.uint8)
    np.testing.assert_array_equal(grid([[("", picture)]])[LABEL_PX:-GAP_PX:2, 1:-GAP_PX:2], picture)


def test_the_sheet_of_large_views_is_no_larger_than_a_picture_that_is_read(tmp_path: Path) -> None:
    """24 test views of 1200x900 px: 213 megapixels as they are, which Pillow takes for an attack."""
    sheet = grid(rows(1200, 900))
    high, wide = sheet.shape[:2]
    assert 0.9 * contact.MOST_PX < high * wide <= contact.MOST_PX
    step_x, step_y = wide / 8, high / 24
    assert (step_x - GAP_PX) / (step_y - GAP_PX - LABEL_PX) == pytest.approx(4 / 3, rel=0.01)
    save(sheet, tmp_path / "sheet.png")
    assert thumbnail_jpeg(tmp_path / "sheet.png")
    assert (sheet[LABEL_PX : int(step_y) - GAP_PX, : int(step_x) - GAP_PX] == 200).all()


def test_however_many_views_there_are(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(contact, "MOST_PX", 24 * 8 * 30 * 40)
    sheet = grid(rows(SMALL_PX, 120))
    assert sheet.shape[0] * sheet.shape[1] <= contact.MOST_PX
    assert Image.MAX_IMAGE_PIXELS and contact.MOST_PX < Image.MAX_IMAGE_PIXELS
