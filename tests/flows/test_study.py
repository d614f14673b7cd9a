"""`aug3d study`: wrong use is told at once; a study ends with a table, a folder, and a run in MLflow for each of its cells."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from typer.testing import CliRunner

from aug3d_core.store import layout
from flows.cli import app
from tests.stand_in_stages import Made
from tests.studies.paper.stand_in import Stages, finished_scene


def invoke(*arguments: str | Path):
    return CliRunner().invoke(app, ["study", *(str(argument) for argument in arguments)])


@pytest.fixture
def stages(monkeypatch: pytest.MonkeyPatch) -> Stages:
    import flows.study_run  # noqa: F401  (the command does, and brings open3d: tests/processes.py must see it)

    stand_in = Stages()
    monkeypatch.setattr("tasks.build_task.build", stand_in.build)
    return stand_in


@pytest.mark.parametrize("study", ["grouping", "augmentation"])
def test_a_scene_that_is_not_there_is_named(study: str, tmp_path: Path) -> None:
    done = invoke(study, "nowhere", "--home", tmp_path)
    assert done.exit_code == 2
    assert "there is no scene 'nowhere'" in done.output and "none yet" in done.output


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("--set", "training.step=5"), "no field 'step'"),
        (("--preset", "huge"), "'huge'"),
        (("--seeds", "0"), "--seeds"),
    ],
)
def test_wrong_use_is_refused(words: tuple[str, ...], said: str, stages: Stages, tmp_path: Path) -> None:
    finished_scene(tmp_path)
    done = invoke("grouping", "little", "--home", tmp_path, "--quick", *words)
    assert done.exit_code == 2
    assert said in done.output.replace("\n", "")
    assert not (tmp_path / layout.STUDIES).exists() and "training" not in stages.computed


@pytest.mark.slow
@pytest.mark.usefixtures("prefect")
def test_settings_that_change_the_test_are_refused(stages: Stages, tmp_path: Path) -> None:
    finished_scene(tmp_path)
    done = invoke("grouping", "little", "--home", tmp_path, "--quick", "--set", "grouping.test_share=0.4")
    assert done.exit_code == 2 and "another test than scene 'little'" in done.output.replace("\n", "")
    assert not (tmp_path / layout.STUDIES).exists() and "training" not in stages.computed


@pytest.mark.slow
@pytest.mark.usefixtures("prefect")
def test_a_study_ends_with_a_table_a_folder_and_nested_runs(stages: Stages, tmp_path: Path) -> None:
    from mlflow.tracking import MlflowClient

    store = finished_scene(tmp_path)

    def fail(stage: str, made: Made) -> str:
        lost = stage == "training" and made["grouping"]["method"] == "sequence" and made["grouping"]["k"] == "auto"
        return "refused: training diverged" if lost else ""

    stages.fails = fail
    done = invoke("grouping", "little", "--home", tmp_path, "--quick", "--json")
    assert done.exit_code == 3, done.output
    told = json.loads(done.stdout)
    folder = Path(told["folder"])
    assert {path.name for path in folder.iterdir()} == {
        layout.STUDY_FINDINGS, layout.STUDY_SCORES, layout.STUDY_CHART, layout.STUDY_PAGE,
        layout.STUDY_PART,
    }  # fmt: skip
    assert json.loads((folder / layout.STUDY_FINDINGS).read_text())["orderings"] == told["orderings"]
    client = MlflowClient(f"sqlite:///{store.root / layout.MLFLOW_DATABASE}")
    experiment = client.get_experiment_by_name("little")
    assert experiment is not None
    runs = client.search_runs([experiment.experiment_id])
    parent = next(run for run in runs if "mlflow.parentRunId" not in run.data.tags)
    cells = [run for run in runs if run.data.tags.get("mlflow.parentRunId") == parent.info.run_id]
    assert len(cells) == len(told["cells"]) == 4 * 2 + 2 * 2
    assert sum(run.info.status == "FAILED" for run in cells) == parent.data.metrics["failed_runs"] == 2
    assert {run.data.params["arm"] for run in cells} == {arm["arm"] for arm in told["arms"]}
    stages.computed.clear()
    stages.fails = lambda stage, made: ""
    (tmp_path / layout.MLFLOW_DATABASE).write_text("this is not a database, but it is longer than a header")
    again = invoke("grouping", "little", "--home", tmp_path, "--quick")
    assert "was not logged to MLflow" in again.output.replace("\n", "")
    assert again.exit_code == 0 and "2 of 2" not in again.output
    assert stages.computed.count("training") == 2, "only the cells that it lacked"
    assert "K 10 is better" not in again.output and "Groups by shared points are better" in again.output
