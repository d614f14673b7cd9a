"""Stages that do no work: each object holds the settings that it was made with, and figures from a formula."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import pandas as pd

from aug3d_core.factory.build import Built, Work
from aug3d_core.factory.walk import Make
from aug3d_core.judging.files import TEST_VIEWS
from aug3d_core.judging.summary import CHEAP
from aug3d_core.run.errors import StageFailed
from aug3d_core.run.files import FILES, JOB
from aug3d_core.run.stage import Stage
from aug3d_core.split.files import SPLIT_TABLE
from aug3d_core.store.record import Record
from aug3d_core.store.store import Store

MADE = "made.json"
EMPTY = {"recipe": "r", "inputs": {}, "versions": {}, "notes": (), "series": {}, "pictures": {}, "peak_mib": 1.0}
SCORES = ("ssim", "flip", "coarse_psnr", *(f"{name}_{kind}" for name in CHEAP for kind in ("psnr", "ssim", "flip")))

Made = dict[str, dict[str, Any]]  # what an object was made with: stage -> settings


class StandIn:
    """Stand in for `build`; subclasses write files and return figures. Counts what is computed."""

    def __init__(self) -> None:
        self.computed: list[str] = []
        self.grew: list[bool] = []
        self.given: dict[str, set[str]] = {}  # names of the inputs of a stage, the last time that it was computed
        self.one_fold = True  # whether a step may read one fold only
        self.fails: Callable[[str, Made], str] = lambda stage, made: ""  # "cause: problem" of a stage that shall fail

    def maker(self, store: Store) -> Make:
        """Return a maker of these stages for a walk."""
        return lambda visit: self.build(store, visit.work, None) if visit.work else None

    def build(self, store: Store, work: Work, _progress: Any) -> Built:
        found = store.find(work.stage.name, work.key)
        return Built(found, cached=True) if found else Built(self._compute(store, work), cached=False)

    def _compute(self, store: Store, work: Work) -> Record:
        stage, config, key = work.stage, work.config, work.key
        given = {name: source.path for name, source in work.sources.items()}
        read = [json.loads((path / MADE).read_text()) for path in given.values() if (path / MADE).exists()]
        self.given[stage.name] = set(given)
        assert not self.one_fold or len({made["grouping"]["fold"] for made in read if "grouping" in made}) <= 1, (
            "a step reads one fold only"
        )
        made: Made = {name: settings for inputs in read for name, settings in inputs.items()}
        made[stage.name] = config.model_dump(mode="json")
        if problem := self.fails(stage.name, made):
            raise StageFailed(stage.name, problem.partition(":")[0], problem, "change something", "", "")
        files = store.work_dir(stage.name, key) / FILES
        files.mkdir(parents=True, exist_ok=True)
        (files / MADE).write_text(json.dumps(made))
        self.computed.append(stage.name)
        self.grew.append(stage.grows)
        cpu_seconds = self.cpu_seconds(stage, made)
        fields = {"metrics": self.figures(stage, made, files), "config": made[stage.name], "state": "ok"}
        fields |= {"seconds": cpu_seconds / 2, "cpu_seconds": cpu_seconds}
        job = {"stage": stage.name, "config": {}, "inputs": {name: str(path) for name, path in given.items()}}
        (files.parent / JOB).write_text(json.dumps(job))
        return store.commit(files.parent, stage.name, key, EMPTY | fields)

    def figures(self, stage: Stage, made: Made, files: Path) -> dict[str, Any]:
        """Write the files that later steps read, and return the metrics of the stage."""
        return {}

    def cpu_seconds(self, stage: Stage, made: Made) -> float:
        """Return what the stage costs."""
        return 2.0


def fold_of(made: Made) -> int:
    """Return the fold that an object belongs to; 0 before the split."""
    return made["grouping"]["fold"] if "grouping" in made else 0


def write_split(files: Path, photos: Sequence[int], roles: Sequence[str]) -> None:
    """Write the table of the split."""
    pd.DataFrame({"photo_id": photos, "role": roles}).to_parquet(files / SPLIT_TABLE)


def write_test(files: Path, psnr_by_photo: Mapping[int, float], others: float = 15.0) -> pd.DataFrame:
    """Write and return the table of the test: a group per photograph; every other score is the same."""
    rows = [
        dict.fromkeys(SCORES, others) | {"group": group, "photo_id": photo, "psnr": psnr}
        for group, (photo, psnr) in enumerate(psnr_by_photo.items())
    ]
    table = pd.DataFrame(rows)
    table.to_parquet(files / TEST_VIEWS)
    return table
