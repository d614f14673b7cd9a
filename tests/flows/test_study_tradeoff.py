"""`aug3d study tradeoff`: wrong use is told at once; it ends with ratios, a folder, and a run in MLflow for each arm."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import pytest
from typer.testing import CliRunner

from aug3d_core.store import layout
from flows.cli import app
from flows.study_tradeoff import worst
from tests.stand_in_stages import Made
from tests.studies.tradeoff.stand_in import Stages, stand_in


def invoke(*arguments: str | Path):
    return CliRunner().invoke(app, ["study", "tradeoff", *(str(argument) for argument in arguments)])


@pytest.fixture
def stages(monkeypatch: pytest.MonkeyPatch) -> Stages:
    stages = stand_in(monkeypatch)
    monkeypatch.setattr("tasks.build_task.build", stages.build)
    return stages


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("nowhere",), "there is no scene 'nowhere'"),
        (("demo", "nowhere"), "there is no scene 'nowhere'"),
        (("demo", "--set", "training.step=5"), "no field 'step'"),
        (("demo", "--preset", "huge"), "'huge'"),
        (("demo", "--seeds", "0"), "--seeds"),
        ((), "Missing argument"),
    ],
)
def test_wrong_use_is_refused_before_anything_is_made(
    words: tuple[str, ...], said: str, stages: Stages, tmp_path: Path
) -> None:
    done = invoke(*words, "--home", tmp_path)
    assert done.exit_code == 2
    assert said in done.output.replace("\n", "") and not stages.computed


def test_the_worst_of_several_scenes_is_told_and_nothing_of_one_that_has_none() -> None:
    one = {"auto_regret_db": 0.1, "auto_time_ratio": 0.5, "search_cost_ratio": 3.0}
    one |= {"search_found_ratio": 1.1, "search_regret_db": 0.0}
    assert worst([one, one | {"auto_time_ratio": 0.2, "auto_regret_db": 0.4}])["auto_regret_db"] == 0.4
    assert worst([one, one | {"auto_regret_db": None}])["auto_regret_db"] is None


@pytest.mark.slow
@pytest.mark.usefixtures("prefect")
def test_a_study_ends_with_ratios_a_folder_and_nested_runs(
    stages: Stages, tmp_path: Path, fresh_mlflow: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from mlflow.tracking import MlflowClient

    from flows.study_run import tradeoff

    shutil.copy(fresh_mlflow, tmp_path / layout.MLFLOW_DATABASE)

    def fail(stage: str, made: Made) -> str:
        return "refused: too few features" if stage == "matching" and made["matching"]["max_features"] == 512 else ""

    stages.fails = fail
    done = invoke("demo", "--home", tmp_path, "--quick", "--json")
    assert done.exit_code == 0, done.output
    told = json.loads(done.stdout)
    scene = told["scenes"][0]
    assert told["auto_regret_db"] == pytest.approx(0.0) and told["search_cost_ratio"] >= 1.0
    assert [one["field"] for one in scene["decisions"]] == ["photos.max_px"]
    assert scene["failed_runs"] == 1 and scene["crashes"] == 0
    client = MlflowClient(f"sqlite:///{tmp_path / layout.MLFLOW_DATABASE}")
    experiment = client.get_experiment_by_name("demo")
    assert experiment is not None
    runs = client.search_runs([experiment.experiment_id])
    parent = next(run for run in runs if "mlflow.parentRunId" not in run.data.tags)
    nested = [run for run in runs if run.data.tags.get("mlflow.parentRunId") == parent.info.run_id]
    assert len(nested) == scene["runs"] == parent.data.metrics["runs"]
    assert sum(run.info.status == "FAILED" for run in nested) == 1
    assert {file.path for file in client.list_artifacts(parent.info.run_id)} >= {layout.STUDY_PAGE, layout.STUDY_CHART}
    stages.computed.clear()
    stages.fails = lambda stage, made: "crash: signal 11" if stage == "matching" else ""
    again = invoke("demo", "--home", tmp_path, "--quick")
    assert again.exit_code == 3 and "crash: signal 11" in again.output.replace("\n", "")
    assert "auto_time_ratio 1.00" in again.output and not stages.computed
    monkeypatch.setenv("AUG3D_HOME", str(tmp_path))
    failed = tradeoff(["demo"], quick=True, return_state=True)
    assert failed.is_failed() and "1 runs ended in a way" in (failed.message or "")
    assert "demo: The best that was tried" in (failed.message or "")
