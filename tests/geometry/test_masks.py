from pathlib import Path

import numpy as np
import pytest

from aug3d_core.geometry.masks import save_mask, used_pixels


@pytest.mark.parametrize(("size", "edge"), [(48, 30), (36, 30), (60, 30), (20, 10)])
def test_a_pixel_of_a_smaller_mask_is_used_where_half_of_it_is(size: int, edge: int, tmp_path: Path) -> None:
    """Whatever the ratio: 48 to 32 px is 1.5, where Pillow's box takes one pixel for the half of it that is covered."""
    used = np.zeros((size, size), bool)
    used[:, :edge] = True
    save_mask(used, tmp_path / "mask.png")
    for small in range(size // 3, size + 1):
        covered = np.clip(edge - np.arange(small) * size / small, 0, size / small) * small / size
        found = used_pixels(tmp_path / "mask.png", (small, size))
        assert found is not None and np.array_equal(found, np.tile(covered > 0.5 - 1e-9, (size, 1)))


def test_a_photograph_without_a_mask_is_used_whole(tmp_path: Path) -> None:
    assert used_pixels(tmp_path / "none.png", (4, 3)) is None
