"""A stranger's first hour, on a very small town: run, run again, change a setting, kill it, run it again."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import pytest

from aug3d_core.bench.small_town import OVERRIDES
from aug3d_core.bench.team import leftovers
from aug3d_core.factory.stages import FROM_TOWN, STAGES
from aug3d_core.judging.summary import CHEAP
from aug3d_core.run.metric import spec_of
from aug3d_core.store.scenes import DIGESTS
from aug3d_core.store.seal import SEAL
from tests.attack.town_process import begun, digests, hand_over

pytestmark = [pytest.mark.slow, pytest.mark.timeout(1500)]


def command(home: Path, *more: str) -> list[str]:
    return [str(Path(sys.executable).parent / "aug3d"), "demo", "--json", "--home", str(home), *OVERRIDES, *more]


def run(home: Path, *more: str, env: Mapping[str, str] | None = None) -> dict[str, Any]:
    """Run the factory; without an environment it starts a Prefect server of its own."""
    done = subprocess.run(command(home, *more), capture_output=True, text=True, env=env)
    assert done.returncode in (0, 3), done.stderr[-3000:] + done.stdout[-2000:]
    return json.loads(done.stdout)


def computed(metrics: dict[str, Any]) -> set[str]:
    return {name for name, figures in metrics["stages"].items() if not figures["cached"]}


def test_the_factory_ends_with_a_psnr_and_its_files(first: dict[str, Any]) -> None:
    assert list(first["stages"]) == [stage.name for stage in FROM_TOWN]
    assert computed(first) == set(first["stages"])
    for name, figures in first["stages"].items():
        undeclared = [metric for metric in figures["metrics"] if not spec_of(metric, STAGES[name].metrics)]
        assert not undeclared, f"declare the figures of {name} in its declared.py: {undeclared}"
        assert figures["seconds"] > 0 and figures["peak_mib"] > 0
        assert STAGES[name].accuracy in figures["metrics"], f"{name} reports its accuracy figure"
    nvs = first["nvs"]
    assert nvs["test_views"] >= 1 and 5 < nvs["test_psnr_mean"] < 60
    assert (nvs["test_psnr_ci"] is None) == (nvs["test_views"] == 1)
    assert set(nvs["cheap"]) == set(CHEAP)
    assert set(nvs["groups"]) == {"best", "low", "average"}
    for place in ("metrics", "report"):
        assert Path(first["paths"][place]).is_file()


def test_reconstruction_is_right_to_the_truth(first: dict[str, Any]) -> None:
    truth = first["stages"]["truth"]["metrics"]
    assert truth["registered_share"] == 1
    assert truth["position_error_pct"] < 1


def test_show_tells_the_same(first: dict[str, Any], home: Path) -> None:
    aug3d = str(Path(sys.executable).parent / "aug3d")
    done = subprocess.run([aug3d, "show", "demo", "--json", "--home", str(home)], capture_output=True, text=True)
    written = json.loads(Path(first["paths"]["metrics"]).read_text())
    assert json.loads(done.stdout) == {name: value for name, value in written.items() if name not in (SEAL, DIGESTS)}
    readable = subprocess.run([aug3d, "show", "demo", "--home", str(home)], capture_output=True, text=True)
    assert (
        "plane sweep" in readable.stdout
        and "sweep without learning" in readable.stdout
        and "report.html" in readable.stdout
    )


def test_advice_for_it_is_written_and_names_places(first: dict[str, Any], home: Path, tmp_path: Path) -> None:
    aug3d = str(Path(sys.executable).parent / "aug3d")
    folder = tmp_path / "advice"
    done = subprocess.run(
        [aug3d, "advise", "demo", str(folder), "--photos", "3", "--json", "--home", str(home)],
        capture_output=True,
        text=True,
    )
    told = json.loads(done.stdout)
    assert {path.name for path in folder.iterdir()} == set(told["files"]) >= {"advice.html", "mission.kmz"}
    assert len(told["photographs"]) == 3 and told["missing"] == sorted(told["missing"], reverse=True)
    assert all(one["xyz"][2] >= told["floor"] >= told["highest_roof"] + 15 for one in told["photographs"])
    again = subprocess.run([aug3d, "advise", "demo", str(folder), "--home", str(home)], capture_output=True, text=True)
    assert again.returncode == 2 and "not an empty folder" in again.stderr + again.stdout


def test_mlflow_holds_the_run(first: dict[str, Any], home: Path) -> None:
    code = (
        "import sys, json; from mlflow.tracking import MlflowClient; c = MlflowClient(sys.argv[1]);"
        "r = c.search_runs([c.get_experiment_by_name('demo').experiment_id], order_by=['start_time'])[0];"
        "print(json.dumps([r.data.params, r.data.metrics, r.data.tags, [a.path for a in c.list_artifacts(r.info.run_id)],"
        "len(c.get_metric_history(r.info.run_id, 'training.train_psnr'))]))"
    )
    done = subprocess.run([sys.executable, "-c", code, first["paths"]["mlflow"]], capture_output=True, text=True)
    params, metrics, tags, artifacts, steps = json.loads(done.stdout)
    assert params["training.steps"] == "30"
    assert metrics["evaluation.test_psnr_mean"] == pytest.approx(first["nvs"]["test_psnr_mean"])
    assert tags["scene"] == "demo" and tags["digest.dataset"] == first["stages"]["dataset"]["digest"]
    assert {"report.html", "evaluation", "sfm"} <= set(artifacts)
    assert steps > 1


def test_a_second_run_computes_nothing(first: dict[str, Any], home: Path, served: dict[str, str]) -> None:
    again = run(home, env=served)
    assert computed(again) == set()
    assert digests(again) == digests(first)


def test_a_training_setting_runs_only_training_and_evaluation(
    first: dict[str, Any], home: Path, served: dict[str, str]
) -> None:
    changed = run(home, "--set", "training.steps=31", env=served)
    assert computed(changed) == {"training", "evaluation"}


def test_in_folds_both_ends_are_tested_and_what_the_folds_share_is_kept(
    first: dict[str, Any], home: Path, served: dict[str, str]
) -> None:
    quick = ("--set", "grouping.folds=2", "--set", "depth.max_px=128", "--set", "training.steps=5")
    folded = run(home, *quick, env=served)
    shared = [stage.name for stage in FROM_TOWN[: FROM_TOWN.index(STAGES["grouping"])]]
    assert computed(folded).isdisjoint(shared)
    assert "evaluation_fold1" in folded["stages"]
    roles = [folded["stages"][name]["metrics"] for name in ("grouping", "grouping_fold1")]
    held_out = sum(metrics["support_views"] + metrics["target_views"] for metrics in roles)
    assert 2 * 5 <= held_out <= first["stages"]["sfm"]["metrics"]["registered"]
    assert folded["nvs"]["test_views"] == sum(metrics["target_views"] for metrics in roles)
    assert computed(run(home, *quick, env=served)) == set()


def test_killed_at_many_moments_it_ends_in_the_same_digests(
    first: dict[str, Any], tmp_path: Path, served: dict[str, str]
) -> None:
    """SIGKILL the factory whenever one more stage has begun, until a run gets through.

    Prefect's server is the factory's own at the first kill and in the last run, and ends or goes on with it. What lies
    between the stages that are killed is there already, made by the first run: a run that finds it has come to the same.
    """
    hand_over(first, tmp_path, but=("town", "depth", "training", "evaluation"))
    killed, elsewhere = 0, {**served, "PREFECT_HOME": str(tmp_path / "prefect")}
    for stage in ("town", "depth", "training"):
        env = elsewhere if killed else None
        factory = subprocess.Popen(command(tmp_path), env=env, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        if wait_for_work(tmp_path, stage, factory):
            time.sleep(1.0)
            os.kill(factory.pid, signal.SIGKILL)
            killed += 1
        factory.wait()
    assert killed >= 2
    assert not leftovers(tmp_path), "nothing outlives a killed factory"
    last = run(tmp_path)
    assert digests(last) == digests(first)
    assert computed(last) <= {"training", "evaluation"}, "what was finished before a kill was kept"
    assert "evaluation" in computed(last)


def wait_for_work(home: Path, stage: str, factory: subprocess.Popen) -> bool:
    while factory.poll() is None:
        if begun(home, stage):
            return True
        time.sleep(0.05)
    return False
