"""`aug3d compare`: versions by their names, without MLflow; runs by their id, with it."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import pytest
from typer.testing import CliRunner

from aug3d_core.store import layout
from aug3d_core.store.published import publish
from aug3d_core.store.store import Store
from flows.cli import app
from tasks.mlflow_outbox import Entry, put, waiting
from tests.tasks.logged import version


def invoke(home: Path, *words: str):
    return CliRunner().invoke(app, ["compare", *words, "--home", str(home)])


@pytest.fixture
def versions(tmp_path: Path) -> list[Path]:
    return [version(tmp_path, "a", 21.0), version(tmp_path, "b", 22.0), version(tmp_path, "b", 22.0, photos="q")]


def told(home: Path, *words: str) -> dict:
    done = invoke(home, *words, "--json")
    assert done.exit_code == 0, done.output
    return json.loads(done.stdout)


def test_a_person_reads_what_differs_and_which_is_better(tmp_path: Path, versions: list[Path]) -> None:
    done = invoke(tmp_path, *(f"town@{folder.name}" for folder in versions[:2]))
    assert done.exit_code == 0, done.output
    assert "the scores can be compared" in done.output and "+1.00 dB better" in done.output
    assert "against A: " not in done.output, "no photograph's own score is known, and the intervals are apart"
    assert "21.00 [21.00, 21.00]" in done.output and "settings: no difference" in done.output
    assert "training.train_psnr" not in done.output, "it is the same"
    assert "training.train_psnr" in invoke(tmp_path, "town", "town", "--all").output


def test_photographs_are_paired_by_what_they_are_not_by_their_numbers(tmp_path: Path) -> None:
    before = version(tmp_path, "a", 21.0, each={"x": 18.0, "y": 21.0, "z": 24.0})
    version(tmp_path, "b", 21.5, each={"z": 24.4, "x": 18.5, "y": 21.6})
    said = "B against A: +0.50 dB [+0.25, +0.75] over the same 3 photographs"
    assert said in invoke(tmp_path, f"town@{before.name}", "town").output
    gain = told(tmp_path, f"town@{before.name}", "town")["gains"][1]
    assert gain["photos"] == 3 and gain["mean_db"] == pytest.approx(0.5)


def test_other_photographs_are_told(tmp_path: Path, versions: list[Path]) -> None:
    done = invoke(tmp_path, f"town@{versions[0].name}", "town")
    assert "the scores cannot be compared: other test photographs" in done.output and "dB better" not in done.output


def test_a_version_is_named_as_newest_as_published_and_by_the_beginning_of_its_time(
    tmp_path: Path, versions: list[Path]
) -> None:
    publish(Store(tmp_path), versions[0])
    runs = told(tmp_path, "town", "town@published", f"town@{versions[1].name}")["runs"]
    assert runs == [f"town@{versions[i].name}" for i in (2, 0, 1)]


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("town",), "1 run to compare"),
        (("lake", "town"), "there is no scene 'lake'"),
        (("town@2", "town"), "3 versions of scene 'town' begin with '2'"),
        (("town@1999", "town"), "0 versions of scene 'town' begin with '1999'"),
        (("town@", "town"), "0 versions"),
        (("town@published", "town"), "no version of scene 'town' is published"),
        (("../town@2", "town"), "is not a scene name"),
        (("town",) * 27, "27 runs are too many"),
    ],
)
def test_a_run_that_is_not_there_is_named(
    words: tuple[str, ...], said: str, tmp_path: Path, versions: list[Path]
) -> None:
    done = invoke(tmp_path, *words)
    assert done.exit_code == 2 and said in done.output.replace("\n", "")


def test_a_version_whose_objects_are_gone_is_compared_by_its_figures(tmp_path: Path, versions: list[Path]) -> None:
    shutil.rmtree(tmp_path / layout.OBJECTS)
    found = told(tmp_path, f"town@{versions[0].name}", f"town@{versions[1].name}")
    assert found["params"] == [] and found["headline"][0]["values"] == [21.0, 22.0]


@pytest.mark.slow
@pytest.mark.usefixtures("prefect")
def test_what_waited_is_logged_and_runs_are_found_by_their_id(
    tmp_path: Path, versions: list[Path], fresh_mlflow: Path
) -> None:
    from mlflow.tracking import MlflowClient

    store = Store(tmp_path)
    shutil.copy(fresh_mlflow, tmp_path)
    for folder in versions:
        put(store, Entry(scene="town", version=folder.name))
    done = invoke(tmp_path, "town", "town")
    assert done.exit_code == 0 and versions[0].name in done.stderr and waiting(store) == []
    client = MlflowClient(f"sqlite:///{tmp_path / layout.MLFLOW_DATABASE}")
    experiment = client.get_experiment_by_name("town")
    assert experiment is not None
    logged = {run.info.run_name or "": run for run in client.search_runs([experiment.experiment_id])}
    ids = [logged[folder.name].info.run_id for folder in versions[:2]]
    by_id = told(tmp_path, *(run_id[:12] for run_id in ids))
    assert by_id == told(tmp_path, *(f"town@{folder.name}" for folder in versions[:2]))
    shutil.rmtree(versions[0])
    from_mlflow = told(tmp_path, ids[0], ids[1])
    assert [row["values"] for row in from_mlflow["headline"]] == [row["values"] for row in by_id["headline"]]
    assert from_mlflow["not_comparable"] == "" and from_mlflow["params"] == []
    nobody = invoke(tmp_path, "0000ffff", "town")
    assert nobody.exit_code == 2 and "no run in MLflow" in nobody.output.replace("\n", " ")
    (tmp_path / layout.MLFLOW_DATABASE).write_text("this is not a database, but it is longer than a header")
    broken = invoke(tmp_path, ids[0], "town")
    assert broken.exit_code == 1 and "cannot be used" in broken.output.replace("\n", "")
