"""What `aug3d bench heads` measures, over stages that do no work: the contract's figures, from the objects that there are."""

from __future__ import annotations

from functools import partial
from pathlib import Path

import pytest
from PIL import Image

from aug3d_core.bench import heads
from aug3d_core.dataset.files import SCENE_ZARR
from aug3d_core.judging.files import TEST_VIEWS
from aug3d_core.run.files import FILES
from aug3d_core.store.store import Store
from aug3d_core.studies.common.trial import Measured
from tests.collections.stand_in import Stages
from tests.stand_in_stages import Made, write_test


class Judged(Stages):
    """Tests with figures from the inputs alone, and trainings that take their steps."""

    def figures(self, stage, made, files):
        found = super().figures(stage, made, files)
        if stage.name == "evaluation":
            views = write_test(files, {1: 26.0, 2: 27.0}, others=20.0)
            views.assign(inputs_alone_psnr=[23.0, 24.0], inputs_alone_ssim=0.75).to_parquet(files / TEST_VIEWS)
            found |= {"inputs_alone_psnr_mean": 12.0, "test_psnr_mean": 21.0}
        return found

    def cpu_seconds(self, stage, made):
        return made["training"]["steps"] / 4 if stage.name == "training" else 2.0


@pytest.fixture
def coast(tmp_path: Path) -> Path:
    """Return a folder of photographs."""
    photos = tmp_path / "coast"
    photos.mkdir()
    for number in range(3):
        Image.new("RGB", (32, 24), (number, 0, 0)).save(photos / f"{number}.jpg")
    return photos


@pytest.mark.parametrize("fails", ["coast", "coast_never_seen"])
def test_an_evaluation_that_fails_is_told_beside_the_other_figures(
    fails: str, coast: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail(stage: str, made: Made) -> str:
        if stage != "evaluation" or made["training"]["head"].get("start") == "random":
            return ""
        elsewhere = made["training"]["head"]["name"] == "sweep" and made["evaluation"]["flythrough_frames"] == 0
        return "memory: killed" if (elsewhere if fails == "coast_never_seen" else "town" not in made) else ""

    stages = Judged()
    stages.fails = fail
    monkeypatch.setattr(heads, "directly", lambda store, say: stages.maker(store))
    monkeypatch.setattr(heads, "in_own_process", lambda job: (0.2, 0.5))
    found = heads.figures(Store(tmp_path / "store"), Measured("tiny"), lambda *said: None, {"coast": coast})
    [(name, figure)] = [(name, figure) for name, figure in found.items() if figure.failure]
    assert name == fails and figure.value is None and "memory: killed" in figure.failure
    assert found["town_free_psnr"].value == 23.5 and ("coast_free_psnr" in found) == (fails != "coast")


def test_every_figure_of_the_contract_is_measured(coast: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    stages, timed = Judged(), []

    def timing(job: partial) -> tuple[float, float]:
        model, data = job.args
        assert model.name == FILES and data.name == SCENE_ZARR and data.parent.is_dir()
        timed.append(data)
        return 0.2, 0.5

    monkeypatch.setattr(heads, "directly", lambda store, say: stages.maker(store))
    monkeypatch.setattr(heads, "in_own_process", timing)
    found = heads.figures(Store(tmp_path / "store"), Measured("tiny"), lambda *said: None, {"coast": coast})
    assert not [f"{key}: {figure.failure}" for key, figure in found.items() if figure.failure]
    assert found["view_seconds_256"].value == found["view_seconds_512"].value == 0.2 and len(set(timed)) == 2
    assert found["untrained_psnr"].value == 12.0
    assert found["train_processor_seconds"].value == 25
    assert found["town_pixelnerf_steps"].value == 100, "as many as take the sweep's time"
    assert found["coast_never_seen_scaffold_psnr"].value == 26.5 and found["coast_free_psnr"].value == 23.5
    assert found["town_scaffold_over_mesh_db"].value == 6.5 and found["town_scaffold_over_mesh_low"].holds
