import numpy as np
from PIL import Image

from aug3d_core.rendering.sheet import contact_sheet, save_sheet


def test_pictures_lie_in_rows_on_white():
    images = [np.full((7, 11, 3), i, np.uint8) for i in range(3)]
    sheet = contact_sheet(images, columns=2)
    assert sheet.shape == (16, 24, 3)
    assert sheet[3, 5, 0] == 0 and sheet[3, 18, 0] == 1 and sheet[12, 5, 0] == 2
    assert (sheet[9:, 13:] == 255).all()


def test_no_pictures_no_file(tmp_path):
    save_sheet([], tmp_path / "a.png")
    assert not (tmp_path / "a.png").exists()
    save_sheet([np.zeros((7, 11, 3), np.uint8)], tmp_path / "a.png")
    with Image.open(tmp_path / "a.png") as image:
        assert image.size == (11, 7)


def test_large_pictures_are_made_smaller_so_that_a_sheet_can_be_opened(tmp_path):
    save_sheet([np.zeros((900, 1200, 3), np.uint8)] * 16, tmp_path / "a.png")
    with Image.open(tmp_path / "a.png") as image:
        assert image.size[0] <= 8 * 514 and image.size[0] * image.size[1] < 30e6
