"""The factory's composition, with stages that do nothing but leave a record: what is made in which fold, from what."""

from __future__ import annotations

import json
import shutil
from pathlib import Path
from typing import Any

import pytest
from PIL import Image
from rich.console import Console
from typer.testing import CliRunner

from aug3d_core.factory.config import scene_config
from aug3d_core.factory.material import Material
from aug3d_core.factory.stages import FROM_PHOTOS, GROUPING
from aug3d_core.factory.walk import planned
from aug3d_core.metrics.comparison import compare, side
from aug3d_core.run.errors import StageFailed
from aug3d_core.store import layout
from aug3d_core.store.published import held_back
from aug3d_core.store.store import Store
from flows.cli import app
from flows.display import Display
from tests.flows.stand_in import FEW, Stages, make_of_few
from tests.stand_in_stages import MADE, fold_of

pytestmark = [pytest.mark.slow, pytest.mark.usefixtures("prefect")]
LATER = [stage.name for stage in FROM_PHOTOS[FROM_PHOTOS.index(GROUPING) :]]
FOLDS = 2


@pytest.fixture(autouse=True)
def mlflow_is_ready(fresh_mlflow: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Give each test a database that is made already: MLflow takes seconds for it."""
    monkeypatch.setenv("MLFLOW_TRACKING_URI", f"sqlite:///{shutil.copy(fresh_mlflow, tmp_path)}")


@pytest.fixture
def stages(monkeypatch: pytest.MonkeyPatch) -> Stages:
    stand_in = Stages(FOLDS)
    monkeypatch.setattr("tasks.build_task.build", stand_in.build)
    return stand_in


@pytest.fixture
def few(stages: Stages, monkeypatch: pytest.MonkeyPatch) -> Stages:
    make_of_few(monkeypatch)
    return stages


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "photos").mkdir()
    (tmp_path / "photos" / "a.jpg").write_bytes(b"a photograph")
    return tmp_path / "photos"


def run(home: Path, folder: Path, auto: tuple[str, ...] = ()) -> dict[str, Any]:
    from flows.factory import factory

    config = scene_config("tiny").model_copy(update={"auto": auto})
    return factory("little", str(folder), "tiny", config, str(home))


def test_a_picture_that_cannot_be_shown_costs_no_run(
    few: Stages, folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(*_: object, **__: object) -> None:
        raise Image.DecompressionBombError("larger than a picture may be")

    monkeypatch.setattr("tasks.artifacts.create_table_artifact", refuse)
    assert run(tmp_path / "home", folder)["nvs"]["test_psnr_mean"] == 20.5


def test_a_small_scene_is_made_fold_by_fold_and_judged_on_all(
    stages: Stages, folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    metrics = run(tmp_path / "home", folder, auto=("depth.max_px",))
    assert list(metrics["stages"]) == [stage.name for stage in FROM_PHOTOS] + [f"{name}_fold1" for name in LATER]
    assert metrics["nvs"]["test_views"] == 2 * FOLDS and metrics["nvs"]["fold_psnr_means"] == [20, 21]
    assert metrics["nvs"]["test_psnr_mean"] == 20.5 and metrics["nvs"]["test_psnr_ci"][0] < 20.5
    made = Path(metrics["paths"]["objects"]["dataset_fold1"]) / MADE
    assert json.loads(made.read_text())["grouping"]["fold"] == 1
    assert metrics["mlflow"]["run_id"] and metrics["flow_run"]["id"] and not metrics["mlflow"]["waiting"]
    depths = [row for row in metrics["needs"] if row["by"] == "auto"]
    assert [(row["step"], row["value"]) for row in depths] == [("depth", 512), ("depth_fold1", 512)]
    made = Path(metrics["paths"]["objects"]["depth_fold1"]).parent / layout.RECORD
    assert json.loads(made.read_text())["config"]["max_px"] == 512, "the stage is told what was decided"
    stages.computed.clear()
    monkeypatch.setenv("MLFLOW_TRACKING_URI", "http://127.0.0.1:1")  # nothing listens there: the run goes on
    again = run(tmp_path / "home", folder, auto=("depth.max_px",))
    assert stages.computed == [] and all(figures["cached"] for figures in again["stages"].values())
    assert "cannot be used" in again["mlflow"]["waiting"] and again["state"] == metrics["state"]


def test_folds_are_compared_where_all_their_test_photographs_are_the_same(
    few: Stages, folder: Path, tmp_path: Path
) -> None:
    first = run(tmp_path / "first", folder)
    few.psnr_db = 10.0
    worse = run(tmp_path / "worse", folder)
    assert "PSNR fell by 10.00 dB" in (held_back(worse, first, 0.5) or "")
    few.photographs = "q"
    others = run(tmp_path / "others", folder)
    assert held_back(others, first, 0.5) is None
    assert compare([side("a", first, {}), side("b", others, {})]).not_comparable == "other test photographs"


def test_a_dry_run_and_show_know_the_folds(few: Stages, folder: Path, tmp_path: Path) -> None:
    home = tmp_path / "home"
    runner, words = CliRunner(), ["run", "little", "--photos", str(folder), "--home", str(home), "--dry-run"]
    before = runner.invoke(app, words)
    assert "a scene that turns out to be small is made in folds" in before.output and "_fold1" not in before.output
    run(home, folder)
    plan = list(planned(Store(home), Material(photos=folder), scene_config("tiny")))
    assert plan[-1].step.name == "evaluation_fold1" and all(visit.record for visit in plan)
    after = json.loads(runner.invoke(app, [*words, "--json"]).stdout)
    assert {"stage": "depth_fold1", "cached": True, "seconds": None, "peak_mib": None, "disk_mib": None} in after
    shown = runner.invoke(app, ["show", "little", "--home", str(home)])
    assert "2 folds: every figure is over all of them" in shown.output and "4 views" in shown.output
    assert "training_fold1" in shown.output


def test_a_run_that_would_make_the_same_again_says_so_and_starts_no_server(
    few: Stages, folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    home, words = tmp_path / "home", ["run", "little", "--photos", str(folder), "--json"]
    first = json.loads(CliRunner().invoke(app, [*words, "--home", str(home)]).stdout)
    assert not any(figures["cached"] for figures in first["stages"].values())
    folders = home / "scenes" / "little"

    def again(*more: str) -> dict[str, Any] | None:
        """Return what a run tells that needs no server; None if it starts one."""
        started: list[Path] = []
        with monkeypatch.context() as patch:
            patch.setattr("flows.cli.prefect_server", lambda home: started.append(home))  # which is no context
            told = CliRunner().invoke(app, [*words, "--home", str(home), *more])
        return None if started else json.loads(told.stdout)

    told = again()
    assert told and all(figures["cached"] for figures in told["stages"].values())
    assert told["nvs"] == first["nvs"] and told["paths"] == first["paths"] and len([*folders.iterdir()]) == 1
    assert again("--set", "evaluation.panels=5") is None and again("--preset", "small") is None

    version = Path(first["paths"]["metrics"]).parent
    (version / layout.TOLD).rename(version / "else")  # as if it had been killed before MLflow knew
    assert again() is None
    (version / "else").rename(version / layout.TOLD)
    with monkeypatch.context() as patch:
        patch.setattr("flows.plan.code_version", lambda: "another")
        assert again() is None
    assert again()
    for damaged in (Path(first["paths"]["objects"]["surface"]) / MADE, version / layout.REPORT):
        whole = damaged.read_bytes()
        damaged.write_bytes(whole[::-1])
        assert again() is None
        damaged.write_bytes(whole)


def test_a_full_disk_names_what_the_rest_of_the_run_may_need(few: Stages, folder: Path, tmp_path: Path) -> None:
    few.fails = lambda stage, made: "disk: no space left" if stage == "surface" else ""
    with pytest.raises(StageFailed, match="no space left") as caught:
        run(tmp_path / "home", folder)
    assert "what is left of this run may need " in caught.value.remedy and caught.value.remedy in str(caught.value)
    assert caught.value.remedy.endswith("MiB")
    few.fails = lambda stage, made: "refused: no surface" if stage == "surface" else ""
    with pytest.raises(StageFailed) as caught:
        run(tmp_path / "home", folder)
    assert "may need" not in caught.value.remedy


def test_a_fold_that_fails_ends_the_run_and_leaves_no_figure(few: Stages, folder: Path, tmp_path: Path) -> None:
    few.fails = lambda stage, made: "refused: no surface" if (stage, fold_of(made)) == ("surface", 1) else ""
    with pytest.raises(StageFailed, match="no surface"):
        run(tmp_path / "home", folder)
    shown = json.loads(CliRunner().invoke(app, ["show", "little", "--home", str(tmp_path / "home"), "--json"]).stdout)
    assert shown["state"] == "refused" and "nvs" not in shown
    assert "evaluation" in shown["stages"] and list(shown["stages"])[-1] == "depth_fold1"
    few.fails = lambda stage, made: ""
    few.computed.clear()
    assert run(tmp_path / "home", folder)["nvs"]["test_views"] == 4
    assert few.computed == ["surface", "training", "evaluation"], "what was made is kept"


def test_the_display_numbers_the_steps_of_every_fold(few: Stages, folder: Path, tmp_path: Path) -> None:
    from tasks.progress import listening

    console = Console(record=True, width=120)
    with Display(console, FEW, {"depth": 100.0}) as display, listening(display):
        run(tmp_path / "home", folder)
    total = 2 * len(FEW) - 1  # photos are taken in once
    text = console.export_text()
    assert f"[{total}/{total}] evaluation_fold1 ..." in text
    assert f"[1/{len(FEW)}] photos ..." in text
