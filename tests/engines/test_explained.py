"""Matches that the poses do not allow are counted, whoever agreed on them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pycolmap
import pytest

from aug3d_core.sfm.explained import explained_share


def exact_flight(database: Path) -> pycolmap.Reconstruction:
    """Write the exact matches of eight photographs; return their poses."""
    pycolmap.set_random_seed(0)
    options = pycolmap.SyntheticDatasetOptions()
    options.num_rigs, options.num_cameras_per_rig, options.num_frames_per_rig, options.num_points3D = 1, 1, 8, 200
    options.match_config = pycolmap.SyntheticDatasetMatchConfig.EXHAUSTIVE
    with pycolmap.Database.open(database) as opened:
        return pycolmap.synthesize_dataset(options, opened)


def confuse(database: Path, share: float) -> None:
    """Join every match of a share of the pairs with another point than its own."""
    with pycolmap.Database.open(database) as opened:
        pair_ids, geometries = opened.read_two_view_geometries()
        for pair_id, geometry in list(zip(pair_ids, geometries, strict=True))[: round(share * len(pair_ids))]:
            matches = geometry.inlier_matches.copy()
            matches[:, 1] = np.roll(matches[:, 1], 7)
            geometry.inlier_matches = matches
            opened.update_two_view_geometry(*pycolmap.pair_id_to_image_pair(pair_id), geometry)


@pytest.mark.parametrize("share", [0.0, 0.25, 0.5])
def test_what_is_confused_is_not_explained(tmp_path: Path, share: float) -> None:
    model = exact_flight(tmp_path / "features.db")
    confuse(tmp_path / "features.db", share)
    assert explained_share(model, tmp_path / "features.db") == pytest.approx(1 - share, abs=0.03)


def test_photographs_that_are_not_placed_do_not_count(tmp_path: Path) -> None:
    model = exact_flight(tmp_path / "features.db")
    confuse(tmp_path / "features.db", 1)
    for frame in list(model.frames.values()):
        model.deregister_frame(frame.frame_id)
    assert explained_share(model, tmp_path / "features.db") is None
