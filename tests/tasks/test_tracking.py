"""MLflow gets every version once; an MLflow that is broken or gone loses nothing and stops nothing."""

from __future__ import annotations

import json
import shutil
import socket
import time
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING
from unittest.mock import Mock

import pytest
from mlflow.entities import Run, ViewType
from mlflow.tracking import MlflowClient

from aug3d_core.run.errors import InputError, StoreError
from aug3d_core.store import layout
from aug3d_core.store.scenes import (
    bring_versions,
    share_version,
    step_objects,
    version_metrics,
    version_paths,
    write_metrics,
)
from aug3d_core.store.store import Store
from tasks.mlflow_outbox import Entry, put, waiting
from tests.tasks.logged import version
from tests.tests_support import fill

if TYPE_CHECKING:
    from tasks.tracking import Flushed, Logged


def log(folder: Path) -> Logged:
    from tasks.tracking import log_run  # Prefect reads its settings when it is imported

    return log_run.fn(folder.parents[2], folder)


def flush(home: Path) -> Flushed:
    from tasks.tracking import flush

    return flush(Store(home))


def runs(client: MlflowClient, scene: str = "town") -> list[Run]:
    """Return a scene's runs that are nested in none, oldest first."""
    experiment = client.get_experiment_by_name(scene)
    found = [] if experiment is None else client.search_runs([experiment.experiment_id], order_by=["start_time"])
    return [run for run in found if "version" in run.data.tags]


def nested(client: MlflowClient, parent: Run) -> dict[str, Run]:
    found = client.search_runs([parent.info.experiment_id], f"tags.mlflow.parentRunId = '{parent.info.run_id}'")
    return {run.info.run_name or "": run for run in found}


def test_a_run_holds_what_tells_versions_apart(tmp_path: Path, client: MlflowClient) -> None:
    folder = version(tmp_path)
    run = client.get_run(log(folder).run_id)
    assert run.data.params == {"dataset.image_px": "64", "training.steps": "2", "training.hidden": "64"}
    metrics = run.data.metrics
    assert (metrics["seconds"], metrics["work_seconds"], metrics["training.seconds"]) == (3.0, 4.5, 1.5)
    assert (metrics["nvs.test_psnr_mean"], metrics["nvs.cheap_mesh_render"], metrics["nvs.over_best_cheap_db"]) == (
        21.5, 9.0, 12.5,
    )  # fmt: skip
    assert metrics["dataset.views"] == 4 and "training.train_loss" not in metrics
    tags = run.data.tags
    assert (tags["version"], tags["folder"], tags["state"]) == (folder.name, str(folder), "ok")
    assert (tags["test_photos"], tags["conventions"]) == ("p", "c")
    assert "PSNR **21.50 dB**" in tags["mlflow.note.content"]
    artifacts = {artifact.path for artifact in client.list_artifacts(run.info.run_id)}
    assert artifacts == {"report.html", "metrics.json", "evaluation", "model"}
    assert run.inputs is not None
    data = run.inputs.dataset_inputs[0].dataset
    digest = json.loads((folder / layout.METRICS).read_text())["stages"]["dataset"]["digest"]
    assert digest.startswith(data.digest) and json.loads(data.profile or "")["digest"] == digest


def test_each_step_is_a_run_within_with_its_settings_figures_curves_and_pictures(
    tmp_path: Path, client: MlflowClient
) -> None:
    parent = client.get_run(log(version(tmp_path, cached=("evaluation",))).run_id)
    steps = nested(client, parent)
    assert set(steps) == {"dataset", "training", "evaluation"}
    training = steps["training"]
    assert training.data.params == {"training.steps": "2", "training.hidden": "64"}
    assert (training.info.end_time or 0) - training.info.start_time == 1500
    assert (
        parent.info.start_time
        < steps["dataset"].info.start_time
        < training.info.start_time
        < steps["evaluation"].info.start_time
    )
    for run_id, name in ((training.info.run_id, "train_loss"), (parent.info.run_id, "train_psnr")):
        assert [point.step for point in client.get_metric_history(run_id, f"training.{name}")] == [1, 2]
    pictures = {step: [file.path for file in client.list_artifacts(run.info.run_id)] for step, run in steps.items()}
    assert pictures == {"dataset": [], "training": ["panel.png"], "evaluation": []}, (
        "what was cached is not copied again"
    )


def test_a_failed_run_is_marked_as_failed_and_says_why(tmp_path: Path, client: MlflowClient) -> None:
    run = client.get_run(log(version(tmp_path, failure=InputError("no photos", "add some"))).run_id)
    assert run.info.status == "FAILED" and run.data.tags["state"] == "refused"
    assert "no photos" in run.data.tags["mlflow.note.content"]


def test_folds_stand_side_by_side(tmp_path: Path, client: MlflowClient) -> None:
    folder = version(tmp_path)
    metrics = version_metrics(folder)
    for part in (metrics["stages"], metrics["objects"]):
        part["training_fold1"] = part["training"]
    write_metrics(folder, metrics)
    steps = nested(client, client.get_run(log(folder).run_id))
    assert steps["training_fold1"].data.params == steps["training"].data.params
    assert steps["training_fold1"].data.tags["stage"] == "training"


def test_what_is_gone_from_the_store_is_logged_as_far_as_the_version_knows(
    tmp_path: Path, client: MlflowClient
) -> None:
    folder = version(tmp_path)
    shutil.rmtree(tmp_path / layout.OBJECTS / "training")
    run = client.get_run(log(folder).run_id)
    assert run.data.metrics["training.train_psnr"] == 20 and "training.steps" not in run.data.params


def test_a_deleted_experiment_is_brought_back(tmp_path: Path, client: MlflowClient) -> None:
    log(version(tmp_path))
    client.delete_experiment(runs(client)[0].info.experiment_id)
    assert log(version(tmp_path)).waiting == ""


@pytest.mark.parametrize("moved", ["new home", "home_2", "a/home"])
def test_artifacts_move_with_their_home(tmp_path: Path, client: MlflowClient, moved: str) -> None:
    home, there = tmp_path / "home", tmp_path / "elsewhere" / moved
    home.mkdir()
    shutil.move(tmp_path / layout.MLFLOW_DATABASE, home)
    first = log(version(home)).run_id
    there.parent.mkdir(parents=True)
    shutil.move(home, there)
    second = log(version(there, "20260102-000000")).run_id
    now = MlflowClient(f"sqlite:///{there / layout.MLFLOW_DATABASE}")
    for run in (first, second):
        assert now.get_run(run).info.artifact_uri.startswith((there / layout.MLFLOW_ARTIFACTS).as_uri())
        assert "report.html" in {file.path for file in now.list_artifacts(run)}
    assert not home.exists(), "nothing is written where the home was"


def closed_port() -> str:
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        return f"http://127.0.0.1:{taken.getsockname()[1]}"


def test_versions_that_a_server_did_not_take_are_logged_afterwards_in_order(
    tmp_path: Path, client: MlflowClient, monkeypatch: pytest.MonkeyPatch
) -> None:
    from tasks.tracking import publish_model

    monkeypatch.setenv("MLFLOW_TRACKING_URI", closed_port())
    started, missed = time.monotonic(), [version(tmp_path, model) for model in "ab"]
    for folder in missed:
        assert "cannot be used" in log(folder).waiting
    assert publish_model(Store(tmp_path), "town", missed[0].name).run_id == ""
    assert time.monotonic() - started < 10, "a server that is not there costs no minutes"
    monkeypatch.delenv("MLFLOW_TRACKING_URI")
    newest = version(tmp_path, "c")
    assert log(newest).waiting == ""
    assert [run.data.tags["version"] for run in runs(client)] == [folder.name for folder in (*missed, newest)]
    assert [run.data.metrics["nvs.test_psnr_mean"] for run in runs(client)] == [21.5] * 3
    assert client.get_model_version_by_alias("aug3d-town", "published").run_id == runs(client)[0].info.run_id
    assert waiting(Store(tmp_path)) == []


def test_no_password_of_the_servers_address_is_kept_or_told(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from tasks.logged_runs import logged_run
    from tasks.studies import log_study
    from tasks.tracking import said

    monkeypatch.setenv("MLFLOW_TRACKING_URI", closed_port().replace("://", "://me:s3cr@t@"))
    folder, store = version(tmp_path), Store(tmp_path)
    with pytest.raises(StoreError) as caught:
        logged_run(store, "abc")
    told = [log(folder).waiting, str(caught.value), log_study(store, Mock(place="town"), folder)]
    told += [
        json.dumps(version_paths(store, folder, {})),
        said(ValueError("API request to http://me:s3cr@t@there/x failed")),
    ]
    assert all("://***@" in text and "me:" not in text and "cr@t" not in text for text in told)


def test_a_server_that_never_answers_is_given_up(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with socket.socket() as silent:
        silent.bind(("127.0.0.1", 0))
        silent.listen()
        monkeypatch.setenv("MLFLOW_TRACKING_URI", f"http://127.0.0.1:{silent.getsockname()[1]}")
        monkeypatch.setenv("MLFLOW_HTTP_REQUEST_TIMEOUT", "1")
        monkeypatch.setenv("MLFLOW_HTTP_REQUEST_MAX_RETRIES", "0")
        started, folders = time.monotonic(), [version(tmp_path, model) for model in "ab"]
        for folder in folders:
            assert "cannot be used" in log(folder).waiting
    assert time.monotonic() - started < 10 and len(waiting(Store(tmp_path))) == 2


def test_a_database_that_is_broken_is_named_and_filled_when_it_is_mended(tmp_path: Path, fresh_mlflow: Path) -> None:
    (tmp_path / layout.MLFLOW_DATABASE).write_text("this is not a database, but it is longer than a header")
    why = log(version(tmp_path)).waiting
    assert f"{layout.MLFLOW_DATABASE} cannot be used" in why and "the next run" in why
    shutil.copy(fresh_mlflow, tmp_path)
    assert flush(tmp_path).waiting == ""
    assert len(runs(MlflowClient(f"sqlite:///{tmp_path / layout.MLFLOW_DATABASE}"))) == 1


def test_a_full_disk_is_told_in_a_line(
    tmp_path: Path, fresh_mlflow: Path, small_disk: Callable[[int], Path], monkeypatch: pytest.MonkeyPatch, capfd
) -> None:
    database = Path(shutil.copy(fresh_mlflow, small_disk(4)))
    fill(database.parent / "else")
    monkeypatch.setenv("MLFLOW_TRACKING_URI", f"sqlite:///{database}")
    why = log(version(tmp_path)).waiting
    assert "database or disk is full" in why and "\n" not in why
    assert "Traceback" not in capfd.readouterr().err
    (database.parent / "else").unlink()
    assert flush(tmp_path).waiting == ""


@pytest.mark.parametrize("killed_at", ["tasks.version_run.register", "pathlib.Path.unlink"])
def test_a_kill_while_logging_leaves_one_whole_run_at_last(
    killed_at: str, tmp_path: Path, client: MlflowClient, monkeypatch: pytest.MonkeyPatch
) -> None:
    class Killed(BaseException):
        pass

    def kill(*_: object) -> None:
        raise Killed

    folder = version(tmp_path)
    with monkeypatch.context() as patched, pytest.raises(Killed):
        patched.setattr(killed_at, kill)
        log(folder)
    assert len(waiting(Store(tmp_path))) == 1
    flush(tmp_path)
    (run,) = runs(client)
    assert run.info.status == "FINISHED" and len(nested(client, run)) == 3
    active = client.search_runs([run.info.experiment_id], run_view_type=ViewType.ACTIVE_ONLY)
    assert len(active) == 4, "nothing half is left to be seen"
    assert waiting(Store(tmp_path)) == []


def test_a_version_that_mlflow_refuses_does_not_hold_up_the_next(
    tmp_path: Path, client: MlflowClient, monkeypatch: pytest.MonkeyPatch
) -> None:
    bad, good = version(tmp_path), version(tmp_path, "b")
    metrics = version_metrics(bad)
    metrics["stages"]["training"]["metrics"]["no name?"] = 1.0
    write_metrics(bad, metrics)
    put(Store(tmp_path), Entry(scene="town", version=bad.name))
    logged = log(good)
    assert logged.run_id and bad.name in logged.waiting
    assert [entry.version for _, entry in waiting(Store(tmp_path))] == [bad.name]


def test_a_version_of_another_machine_is_logged_with_its_report(
    tmp_path: Path, client: MlflowClient, shared: str
) -> None:
    from tasks.tracking import publish_model

    made = version(tmp_path / "maker")
    share_version(Store(tmp_path / "maker"), made, step_objects(version_metrics(made)).values())
    bring_versions(Store(tmp_path))
    logged = publish_model(Store(tmp_path), "town", made.name)
    files = {file.path for file in client.list_artifacts(logged.run_id)}
    assert files == {"report.html", "metrics.json", "evaluation", "model"} and waiting(Store(tmp_path)) == []


@pytest.mark.usefixtures("either")
def test_a_version_whose_report_is_gone_is_logged_without_it(tmp_path: Path, client: MlflowClient) -> None:
    folder = version(tmp_path)
    (folder / layout.REPORT).unlink()
    run = client.get_run(log(folder).run_id)
    assert "report.html" not in {file.path for file in client.list_artifacts(run.info.run_id)}
    assert f"Without its report: {folder / layout.REPORT} is gone" in run.data.tags["mlflow.note.content"]
    assert waiting(Store(tmp_path)) == []


def test_a_version_that_is_gone_is_dropped_and_a_file_that_is_no_entry_is_passed_over(
    tmp_path: Path, client: MlflowClient
) -> None:
    put(Store(tmp_path), Entry(scene="town", version="2020-01-01"))
    (tmp_path / layout.MLFLOW_OUTBOX / "a.json").write_text("{}")
    assert flush(tmp_path).waiting == "" and waiting(Store(tmp_path)) == []


def test_a_version_that_another_process_logs_first_is_found(
    tmp_path: Path, client: MlflowClient, monkeypatch: pytest.MonkeyPatch
) -> None:
    from tasks import tracking

    def put_and_lose(store: Store, entry: Entry) -> None:
        put(store, entry)
        monkeypatch.setattr(tracking, "put", put)
        flush(store.root)

    monkeypatch.setattr(tracking, "put", put_and_lose)
    assert log(version(tmp_path)).run_id == runs(client)[0].info.run_id
    assert len(runs(client)) == 1


def test_another_process_that_is_logging_is_waited_for_and_then_left_to_it(
    tmp_path: Path, client: MlflowClient, monkeypatch: pytest.MonkeyPatch
) -> None:
    from filelock import FileLock

    monkeypatch.setattr("tasks.mlflow_outbox._TURN_S", 0.1)
    Store(tmp_path)
    with FileLock(tmp_path / layout.LOCKS / f"{layout.MLFLOW_OUTBOX}.lock"):
        assert "another process" in log(version(tmp_path)).waiting
    assert len(waiting(Store(tmp_path))) == 1
