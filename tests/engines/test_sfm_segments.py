"""Mapping in segments: the same bytes wherever it was stopped, as good as in one piece, and no island is lost."""

from __future__ import annotations

import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pycolmap
import pytest

from aug3d_core.geometry.similarity import fit_similarity
from aug3d_core.geometry.transforms import centres
from aug3d_core.geometry.views import Views
from aug3d_core.run.stage import Inputs
from aug3d_core.sfm import segments, stage
from aug3d_core.sfm.config import SfmConfig
from aug3d_core.sfm.files import VIEWS
from aug3d_core.sfm.mapping import Mapped, reconstruct
from tests.engines.little_scene import poses, write_flight
from tests.engines.sfm_runs import run_stage, take_photos

pytestmark = pytest.mark.slow

FLIGHT = poses(4, 4)


def matched(folder: Path) -> Inputs:
    """Take photographs in and match them; return what the sfm stage reads."""
    photos = take_photos(folder / "in", folder / "photos")
    run_stage("matching", folder / "matching", {"photos": photos})
    return {"photos": photos, "matching": folder / "matching" / "files"}


@pytest.fixture(scope="module")
def inputs(tmp_path_factory: pytest.TempPathFactory) -> Inputs:
    folder = tmp_path_factory.mktemp("flown")
    write_flight(folder / "in", FLIGHT, noise_m=0.2)
    return matched(folder)


@pytest.fixture
def short(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(segments, "SEGMENT", 5)


def placed(inputs: Inputs, out: Path) -> dict[str, bytes]:
    """Run the stage and return its files."""
    out.mkdir(exist_ok=True)
    stage.run(inputs, SfmConfig(), out, lambda *_: None)
    return {file.relative_to(out).as_posix(): file.read_bytes() for file in out.rglob("*") if file.is_file()}


def worst_m(out: Path) -> float:
    """Return the largest error of a camera centre after the similarity that best maps them to the truth."""
    at = centres(Views.load(out / VIEWS).cam_from_world)
    fit = fit_similarity(at, centres(FLIGHT))
    return float(np.linalg.norm(fit.apply(at) - centres(FLIGHT), axis=1).max())


def test_stopped_after_any_segment_it_ends_in_the_same_bytes(
    inputs: Inputs, tmp_path: Path, short: None, monkeypatch: pytest.MonkeyPatch
) -> None:
    def kept(images: Path, database: Path, photos: pd.DataFrame, config: SfmConfig, folder: Path, *more: Any) -> Mapped:
        mapped = reconstruct(images, database, photos, config, folder, *more)
        shutil.copytree(folder, tmp_path / "kept")
        return mapped

    with monkeypatch.context() as patch:
        patch.setattr(stage, "reconstruct", kept)
        whole = placed(inputs, tmp_path / "whole")
    folder = tmp_path / "kept" / "anew"
    settled = sorted(folder.iterdir())
    assert [file.name for file in settled] == ["segment_0000", "segment_0001"]
    assert [pycolmap.Reconstruction(file).num_reg_images() for file in settled] == [7, 12]
    assert worst_m(tmp_path / "whole") < 0.15  # as in one piece
    for count in (1, 2):
        out = tmp_path / f"stopped_{count}"
        for file in settled[:count]:
            shutil.copytree(file, out / stage.MAPPING / folder.name / file.name)
        (out / stage.MAPPING / folder.name / "new_segment_0002").mkdir()  # half written
        assert placed(inputs, out) == whole


def test_islands_are_found_though_colmap_goes_on_with_one(tmp_path: Path, short: None) -> None:
    write_flight(tmp_path / "in", poses(3, 2), gps=False, seed=1)
    write_flight(tmp_path / "in", poses(4, 2), gps=False, seed=2, start=6)
    out = tmp_path / "sfm"
    placed(matched(tmp_path), out)
    np.testing.assert_array_equal(Views.load(out / VIEWS).photo_id, np.arange(6, 14))
    other = pycolmap.Reconstruction(out / "other_models" / "1")
    assert other.num_reg_images() == 6


def test_what_grew_from_another_start_is_not_gone_on_with(inputs: Inputs, tmp_path: Path) -> None:
    out = tmp_path / "sfm"
    placed(inputs, out)
    start = pycolmap.Reconstruction(out / "model")
    folders = [segments._folder_from(tmp_path / "mapping", one) for one in (None, start, None, start)]
    assert folders[0] == folders[2] != folders[1] == folders[3]
    start.deregister_frame(start.reg_frame_ids()[0])
    assert segments._folder_from(tmp_path / "mapping", start) not in folders
