"""What `aug3d bench heads` says of a judged scene: each start against its own cheap answers."""

from __future__ import annotations

import json
from pathlib import Path

import pandas as pd
import pytest

from aug3d_core.bench.heads import TOWN_GOALS, _scene_figures
from aug3d_core.judging.files import TEST_VIEWS
from aug3d_core.store.damage import sha256_of
from aug3d_core.store.record import FileEntry
from aug3d_core.store.store import Store
from aug3d_core.studies.common.trial import Trial
from tests.report.made_up_run import record


def judged(home: Path, **scores: float) -> tuple[Store, Trial]:
    """Return a store with an evaluation in which every view has the same scores."""
    store, made = Store(home), record("evaluation")
    file = store.place(made) / TEST_VIEWS
    file.parent.mkdir(parents=True)
    pd.DataFrame([{"group": group, "photo_id": group, **scores} for group in range(4)]).to_parquet(file)
    entry = FileEntry(sha256=sha256_of(file), size_bytes=file.stat().st_size, mtime_ns=file.stat().st_mtime_ns)
    return store, Trial({"evaluation": made.model_copy(update={"files": {TEST_VIEWS: entry}})})


def test_each_start_is_held_against_its_own_answers(tmp_path: Path) -> None:
    cheap = {"ground_homography": 19.0, "plane_sweep": 18.0, "mesh_render": 25.0, "guided_blend": 26.0}
    scores = {f"{name}_psnr": db for name, db in cheap.items()}
    found = _scene_figures(
        *judged(tmp_path, psnr=26.5, ssim=0.9, inputs_alone_psnr=22.5, inputs_alone_ssim=0.7, **scores),
        "town",
        TOWN_GOALS,
    )
    assert found["town_over_ground_homography"].value == pytest.approx(3.5)
    assert found["town_over_guided_blend"].value == pytest.approx(0.5)
    holds = {name: figure.holds for name, figure in found.items() if figure.goal}
    assert holds == {
        "town_inputs_alone_ssim": False,
        "town_over_ground_homography": True,
        "town_over_plane_sweep": True,
        "town_over_mesh_render": False,
        "town_over_guided_blend": False,
    }
    assert json.dumps({name: vars(figure) for name, figure in found.items()})
