"""`aug3d study stability`: wrong use is told at once; it ends with counts, a folder, and a run in MLflow for each cell."""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable
from pathlib import Path

import pytest
from typer.testing import CliRunner

import aug3d_core.studies.stability.catalogue  # noqa: F401  (the study brings Open3D with it: tests/processes.py must see it)
from aug3d_core.factory.walk import Make
from aug3d_core.store import layout
from aug3d_core.store.store import Store
from aug3d_core.studies.common.cell import Cell
from aug3d_core.studies.common.trial import Trial
from aug3d_core.studies.stability.cell import Dosed, StabilityResult
from flows.cli import app


def invoke(*arguments: str | Path):
    return CliRunner().invoke(app, ["study", "stability", *(str(argument) for argument in arguments)])


def sound(_store: Store, cell: Cell[Dosed], _make: Make) -> StabilityResult:
    judge = cell.arm.perturbation.judge
    return StabilityResult(cell, Trial({}), judge.mark, "ok")


@pytest.fixture
def cells(monkeypatch: pytest.MonkeyPatch) -> Callable[[Callable[[Store, Cell[Dosed], Make], StabilityResult]], None]:
    def replace(make_cell: Callable[[Store, Cell[Dosed], Make], StabilityResult]) -> None:
        monkeypatch.setattr("aug3d_core.studies.stability.cell.make_cell", make_cell)

    return replace


def test_a_perturbation_that_is_not_there_is_named(tmp_path: Path) -> None:
    done = invoke("--only", "rain", "--home", tmp_path)
    assert done.exit_code == 2
    assert "no perturbation 'rain'" in done.output and "blur" in done.output


@pytest.mark.slow
@pytest.mark.usefixtures("prefect")
def test_it_ends_with_counts_a_folder_and_nested_runs(cells, fresh_mlflow: Path, tmp_path: Path) -> None:
    from mlflow.tracking import MlflowClient

    shutil.copy(fresh_mlflow, tmp_path)
    cells(sound)
    done = invoke("--only", "slope", "--seeds", 2, "--home", tmp_path, "--json")
    assert done.exit_code == 0, done.output
    told = json.loads(done.stdout)
    assert (told["silent_failures"], told["crashes"]) == (0, 0)
    folder = Path(told["folder"])
    assert {path.name for path in folder.iterdir()} == {
        layout.STUDY_FINDINGS, layout.STUDY_SCORES, layout.STUDY_CHART, layout.STUDY_PAGE,
        layout.STUDY_PART,
    }  # fmt: skip
    client = MlflowClient(f"sqlite:///{tmp_path / layout.MLFLOW_DATABASE}")
    experiment = client.get_experiment_by_name("stability")
    assert experiment is not None
    runs = client.search_runs([experiment.experiment_id])
    parent = next(run for run in runs if "mlflow.parentRunId" not in run.data.tags)
    assert parent.data.metrics["cells"] == len(runs) - 1 == told["cells"]


@pytest.mark.slow
@pytest.mark.usefixtures("prefect")
def test_a_silent_failure_is_said_aloud(cells, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr("tasks.studies.log_study", lambda *_: "")
    cells(lambda store, cell, make: StabilityResult(cell, Trial({}), None, "ok"))
    done = invoke("--only", "terraces", "--seeds", 1, "--home", tmp_path)
    assert done.exit_code == 3
    assert "silent: terraces" in done.output and "SILENT" in done.output


@pytest.mark.slow
@pytest.mark.usefixtures("prefect")
def test_the_flow_of_the_prefect_ui_says_the_same(cells, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    from flows.study_run import stability

    monkeypatch.setattr("flows.study_run.log_study", lambda *_: "MLflow is away")
    monkeypatch.setenv("AUG3D_HOME", str(tmp_path))
    cells(sound)
    well = stability(["terraces"], seeds=1, return_state=True)
    assert well.is_completed() and "none silent" in (well.message or "") and "MLflow is away" in (well.message or "")
    cells(lambda store, cell, make: StabilityResult(cell, Trial({}), None, "ok"))
    ill = stability(["terraces"], seeds=1, return_state=True)
    assert ill.is_failed() and "silent failures" in (ill.message or "")
