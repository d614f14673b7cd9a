"""The paper's tables on a very small town: a quick look, killed and gone on with, and the same test in every cell."""

from __future__ import annotations

import json
import os
import re
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

from aug3d_core.groups.files import GROUPS
from aug3d_core.run.files import FILES
from aug3d_core.split.files import SPLIT_TABLE
from aug3d_core.store import layout
from tests.journeys.test_demo import computed
from tests.journeys.test_demo import run as run_demo

pytestmark = [pytest.mark.slow, pytest.mark.timeout(2400)]

# No group of 10 can be made of its few training photographs: those arms must say so.
SETTINGS = ["--set", "training.steps=5", "--set", "training.head.crop_px=32"]


def command(home: Path, study: str) -> list[str]:
    aug3d = str(Path(sys.executable).parent / "aug3d")
    return [aug3d, "study", study, "demo", "--quick", "--json", "--home", str(home), *SETTINGS]


def run(home: Path, study: str, env: dict[str, str]) -> dict[str, Any]:
    done = subprocess.run(command(home, study), capture_output=True, text=True, env=env)
    assert done.returncode in (0, 3), done.stderr[-3000:] + done.stdout[-2000:]
    return json.loads(done.stdout)


@pytest.fixture(scope="module")
def studied(home: Path, first: dict[str, Any], served: dict[str, str]) -> Path:
    """Return the home with the small town, found made: a study takes the settings of the last run, which may be another."""
    assert not computed(run_demo(home, env=served))
    return home


def test_a_grouping_study_that_is_killed_goes_on(studied: Path, served: dict[str, str]) -> None:
    before = {stage: made(studied, stage) for stage in ("sfm", "depth", "surface")}
    nowhere = subprocess.DEVNULL
    study = subprocess.Popen(command(studied, "grouping"), stdout=nowhere, stderr=nowhere, env=served)
    trained = len(made(studied, "training"))
    while study.poll() is None and len(made(studied, "training")) == trained:
        time.sleep(0.2)
    os.kill(study.pid, signal.SIGKILL)
    study.wait()
    kept = made(studied, "training")
    told = run(studied, "grouping", served)
    arms = {arm["arm"]: arm for arm in told["arms"]}
    assert len(made(studied, "training")) == trained + 2 * 2 and kept <= made(studied, "training")
    assert before == {stage: made(studied, stage) for stage in before}, "poses and mesh are the scene's own"
    for way in ("sequence", "shared"):
        assert arms[f"{way}, K auto"]["average"] > 5 and 3 < arms[f"{way}, K auto"]["k"] <= 6
        assert re.search(r"no groups of 10: there are only \d training views", arms[f"{way}, K 10"]["notes"][0])
    assert {path.name for path in Path(told["folder"]).iterdir()} >= {layout.STUDY_CHART, layout.STUDY_PAGE}
    assert same_tests(studied, told) == 1


def test_an_augmentation_study_adds_virtual_views(studied: Path, served: dict[str, str]) -> None:
    told = run(studied, "augmentation", served)
    arms = {arm["arm"]: arm for arm in told["arms"]}
    assert arms["real, K auto"]["virtual_views"] == 0 and arms["real + grid, K auto"]["virtual_views"] >= 4
    scores = pd.read_parquet(Path(told["folder"]) / layout.STUDY_SCORES)
    assert np.isfinite(scores["psnr"]).all()
    assert same_tests(studied, told) == 1


def made(home: Path, stage: str) -> set[str]:
    return {record.parent.name for record in (home / layout.OBJECTS / stage).glob(f"*/{layout.RECORD}")}


def same_tests(home: Path, told: dict[str, Any]) -> int:
    """Return how many different tests the cells were given: split, targets, and the inputs of each."""
    tests = set()
    for cell in told["cells"]:
        files = home / layout.OBJECTS / "grouping" / cell["objects"]["grouping"] / FILES
        with np.load(files / GROUPS) as groups:
            inputs = groups["test_members"][:, :4].tobytes()
        tests.add((inputs, pd.read_parquet(files / SPLIT_TABLE)["role"].str.cat(sep=" ")))
    return len(tests)
