from filecmp import cmp
from pathlib import Path

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from aug3d_core.domes.boxes import Buildings, boxes_of, merged, overlap

whole = st.integers(0, 20)
sides = st.integers(1, 9)


@given(st.tuples(whole, whole, sides, sides), st.tuples(whole, whole, sides, sides))
def test_overlap_is_that_of_squares_counted_one_by_one(a, b) -> None:
    rasters, rows = [], []
    for x, y, wide, high in (a, b):
        raster = np.zeros((40, 40), bool)
        raster[y : y + high, x : x + wide] = True
        rasters.append(raster)
        rows.append(np.array([[x, y, x + wide, y + high]], float))
    counted = (rasters[0] & rasters[1]).sum() / (rasters[0] | rasters[1]).sum()
    np.testing.assert_allclose(overlap(*rows), [[counted]])


def test_each_part_of_a_mask_has_a_box_in_world_units() -> None:
    mask = np.zeros((10, 12), bool)
    mask[1:3, 2:5] = True
    mask[3:5, 5:6] = True  # touches at a corner
    mask[8, 11] = True
    boxes = boxes_of(mask, np.array([100.0, -50.0]), 0.5)
    np.testing.assert_array_equal(boxes, [[101.0, -49.5, 103.0, -47.5], [105.5, -46.0, 106.0, -45.5]])
    assert boxes_of(np.zeros((3, 4), bool), np.zeros(2), 1.0).shape == (0, 4)


def test_boxes_are_merged_with_their_nearest_and_no_group_comes_twice() -> None:
    boxes = np.array([[0, 0, 1, 1], [2, 0, 3, 1], [10, 0, 11, 1]], float)
    pair, far, whole_row = [0, 0, 3, 1], [2, 0, 11, 1], [0, 0, 11, 1]
    np.testing.assert_array_equal(merged(boxes, 1), [pair, far])
    np.testing.assert_array_equal(merged(boxes, 5), [pair, far, whole_row])
    assert len(merged(boxes, 0)) == 0 and len(merged(boxes[:1], 3)) == 0


def test_of_boxes_that_touch_the_one_with_the_nearer_middle_is_nearest() -> None:
    boxes = np.array([[0, 0, 2, 2], [2, 0, 30, 2], [0, 2, 2, 4]], float)
    assert merged(boxes, 1)[0].tolist() == [0, 0, 2, 4]


@given(st.lists(st.tuples(whole, whole, sides, sides), min_size=1, max_size=8), st.integers(0, 4))
def test_groups_hold_a_box_and_others(rows, most) -> None:
    boxes = np.array([(x, y, x + wide, y + high) for x, y, wide, high in rows], float)
    groups = merged(boxes, most)
    assert len(groups) <= most * len(boxes)
    for group in groups:
        inside = (boxes[:, :2] >= group[:2]).all(axis=1) & (boxes[:, 2:] <= group[2:]).all(axis=1)
        assert inside.sum() >= 2
        np.testing.assert_array_equal(boxes[inside][:, :2].min(axis=0), group[:2])


def test_buildings_are_read_as_written(tmp_path: Path) -> None:
    mask = np.eye(3, dtype=bool)
    found = Buildings(mask, np.ones((2, 4)), ~mask, np.full((3, 3, 3), 7, np.uint8), np.array([1.0, 2.0]), 0.25)
    for name in ("a", "b"):
        found.save(tmp_path / name)
    read = Buildings.load(tmp_path / "a")
    assert read.square == 0.25 and cmp(tmp_path / "a", tmp_path / "b", shallow=False)
    for name in ("mask", "boxes", "covered", "rgb", "low"):
        np.testing.assert_array_equal(getattr(read, name), getattr(found, name))
