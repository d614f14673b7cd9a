import numpy as np

from aug3d_core.town.generator.atlas import Atlas


def test_every_patch_is_found_where_its_coordinates_point():
    rng = np.random.default_rng(0)
    atlas = Atlas()
    patches = [rng.integers(0, 256, (h, w, 3), np.uint8) for h, w in rng.integers(1, 90, (60, 2))]
    assert [atlas.add(p) for p in patches] == list(range(60))
    packed = atlas.pack()
    height, width = packed.image.shape[:2]
    for i, patch in enumerate(patches):
        h, w = patch.shape[:2]
        corners = np.array([[(0.5 / w, 1 - 0.5 / h), (1 - 0.5 / w, 1 - 0.5 / h), (0.5 / w, 0.5 / h)]])
        uv = packed.uv(np.array([i]), corners)[0]
        column, row = (uv[:, 0] * width).astype(int), ((1 - uv[:, 1]) * height).astype(int)
        np.testing.assert_array_equal(packed.image[row, column], [patch[0, 0], patch[0, -1], patch[-1, 0]])


def test_patches_do_not_overlap():
    atlas = Atlas()
    for i in range(200):
        atlas.add(np.full((5 + i % 17, 40 + i % 29, 3), i + 1, np.uint8))
    packed = atlas.pack()
    for i, ((y, x), (h, w)) in enumerate(zip(packed.corner, packed.size, strict=True)):
        assert (packed.image[y - 1 : y + h + 1, x - 1 : x + w + 1] == i + 1).all(), "the rim is the patch's own colour"
