"""A contact sheet of views of any size can be read again."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from aug3d_core.dataset import contact
from aug3d_core.dataset.contact import COLUMNS, GAP_PX, MOST_PX, save_contact_sheet
from aug3d_core.dataset.scene import Scene
from tests.toy_scene import toy_scene


@pytest.fixture(scope="module")
def scene() -> Scene:
    return toy_scene(0, 24, 16)


def drawn(scene: Scene, path: Path) -> np.ndarray:
    save_contact_sheet(scene, path)
    return np.asarray(Image.open(path))


def test_small_views_are_on_it_as_they_are(scene: Scene, tmp_path: Path) -> None:
    sheet = drawn(scene, tmp_path / "sheet.png")
    assert sheet.shape[1] == COLUMNS * (24 + GAP_PX)
    np.testing.assert_array_equal(sheet[:16, :24], scene.images[scene.groups["real"][0, 0]])


def test_large_views_are_shrunk_so_that_the_sheet_is_not_too_large(
    scene: Scene, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert Image.MAX_IMAGE_PIXELS and MOST_PX < Image.MAX_IMAGE_PIXELS
    whole = drawn(scene, tmp_path / "whole.png")
    most = whole.shape[0] * whole.shape[1] // 3
    monkeypatch.setattr(contact, "MOST_PX", most)
    bright = replace(scene, images=np.full_like(scene.images, 200))
    sheet = drawn(bright, tmp_path / "sheet.png")
    height, width = sheet.shape[:2]
    assert 0.5 * most < height * width <= most
    assert width / height == pytest.approx(whole.shape[1] / whole.shape[0], rel=0.1)
    assert (sheet[0, : width // COLUMNS - GAP_PX] == 200).all() and (sheet[:, width // COLUMNS - 1] == 255).all()
