"""Each photograph outside the model is named with the likely reason."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from PIL import Image, ImageFilter

from aug3d_core.photos.files import image_name
from aug3d_core.sfm.unplaced import BARE, BLURRED, ISLAND, NO_OVERLAP, unplaced_notes, unplaced_table

PLACED = 6


@pytest.fixture
def images(tmp_path: Path) -> Path:
    """Return six placed photographs and, from 6 on, one of an island, one bare, one blurred, one of elsewhere."""
    rng = np.random.default_rng(0)
    for photo_id in range(10):
        lumps = rng.integers(0, 256, size=(12, 16), dtype=np.uint8)
        image = Image.fromarray(lumps).resize((160, 120), Image.Resampling.NEAREST)
        if photo_id == 7:
            image = Image.fromarray(np.full((120, 160), 128, np.uint8))
        if photo_id == 8:
            image = image.filter(ImageFilter.GaussianBlur(4))
        image.convert("RGB").save(tmp_path / image_name(photo_id))
    return tmp_path


def tables() -> tuple[pd.DataFrame, pd.DataFrame]:
    photos = pd.DataFrame({"photo_id": range(10), "name": [f"photo_{i}.jpg" for i in range(10)]})
    photos["sharpness"] = [1000.0] * 7 + [2.0, 60.0, 1000.0]
    matching = pd.DataFrame({"photo_id": range(10), "features": [3000] * 7 + [4, 150, 3000]})
    matching["matched_pairs"] = [5] * PLACED + [2, 0, 1, 0]
    return photos, matching


def test_every_reason_is_told(images: Path) -> None:
    photos, matching = tables()
    table = unplaced_table(photos, matching, [range(PLACED), [6]], images)
    assert dict(zip(table["photo_id"], table["reason"], strict=True)) == {
        6: ISLAND,
        7: BARE,
        8: BLURRED,
        9: NO_OVERLAP,
    }
    assert table["component"].tolist() == [1, -1, -1, -1]
    notes = unplaced_notes(table, len(photos))
    assert any("could not be placed (too blurred): photo_8.jpg" in note for note in notes)
    assert any("fall into 2 parts" in note and "part 2 holds 1 of 10: photo_6.jpg" in note for note in notes)


def test_nothing_lost_is_an_empty_table(images: Path) -> None:
    photos, matching = tables()
    table = unplaced_table(photos, matching, [range(10)], images)
    assert len(table) == 0
    assert {"photo_id", "name", "reason"} <= set(table.columns)
    assert unplaced_notes(table, 10) == ()
