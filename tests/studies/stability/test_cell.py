"""A cell on stages that do nothing: what is damaged, what is judged, and what the factory is taken to have said."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from aug3d_core.factory.build import Built, Work
from aug3d_core.factory.material import Source
from aug3d_core.run.errors import StageFailed, StoreError
from aug3d_core.run.files import FILES
from aug3d_core.run.stage import StageConfig
from aug3d_core.split.files import SPLIT_TABLE
from aug3d_core.store.store import Store
from aug3d_core.studies.common.cell import Cell
from aug3d_core.studies.stability.cell import Dosed, StabilityResult, make_cell
from aug3d_core.studies.stability.damage_stage import run as damage
from aug3d_core.studies.stability.perturbation import Computed, Damage, InFactory, Judge, Perturbation
from aug3d_core.town.files import TOWN_PHOTOS

HIGHER = Judge("share", "higher", 0.5, "half", stage="truth")
IN_FACTORY = Perturbation(
    "lost points", "poses", "Points are lost.", "share", (0.0, 0.3, 0.6, 0.9), HIGHER,
    InFactory("truth", lambda dose: (f"town.blur_px={dose}",), Damage("sfm", f"{__name__}:scribble"), ("town.seed",)),
    {"one by one": ("sfm.mapper=incremental",), "at once": ("sfm.mapper=global",)},
)  # fmt: skip
COMPUTED = Perturbation(
    "a world", "groups", "Known exactly.", "turns", (0, 1, 2, 3), Judge("share", "higher", 0.5, "half"),
    Computed("aug3d_core.studies.stability.damages:nothing"),
)  # fmt: skip
Told = dict[str, Any]


class Made:
    """Stand in for `build`: tells what each stage was made with, and says what the test wants it to say."""

    def __init__(self, says: Callable[[str, StageConfig], Told]) -> None:
        self.says = says
        self.configs: dict[str, StageConfig] = {}
        self.read: dict[str, Mapping[str, Source]] = {}

    def __call__(self, store: Store, work: Work) -> Built:
        stage, config, sources = work.stage, work.config, work.sources
        assert not stage.grows, "what a cell finds must not hang on the cells before it"
        self.configs[stage.name], self.read[stage.name] = config, sources
        told = self.says(stage.name, config)
        if "fails" in told:
            raise StageFailed(stage.name, told["fails"], "it ended", "mend it", "", "")
        files = store.work_dir(stage.name, "k") / FILES
        (files / TOWN_PHOTOS).mkdir(parents=True, exist_ok=True)
        (files / TOWN_PHOTOS / "a.jpg").write_text(stage.name)
        (files / SPLIT_TABLE).write_text(stage.name)
        empty = {
            "recipe": "r",
            "inputs": {},
            "versions": {},
            "series": {},
            "pictures": {},
            "peak_mib": 1.0,
            "notes": (),
        }
        loose = {"metrics": {}, "state": "ok", "seconds": 2.0, "cpu_seconds": 1.0, "config": {}}
        return Built(store.commit(files.parent, stage.name, work.key, empty | loose | told), cached=False)


@pytest.fixture
def cell(tmp_path: Path) -> Callable[..., tuple[StabilityResult, Made]]:
    def run(
        perturbation: Perturbation, method: str, says: Callable[[str, StageConfig], Told]
    ) -> tuple[StabilityResult, Made]:
        made = Made(says)
        store = Store(tmp_path)
        cell = Cell(Dosed(perturbation, 0.6, method), 3)
        return make_cell(store, cell, lambda visit: made(store, visit.work) if visit.work else None), made

    return run


def test_the_dose_the_method_and_the_seed_reach_the_stages_and_the_damage(cell) -> None:
    result, made = cell(IN_FACTORY, "at once", lambda stage, _: {"metrics": {"share": 0.6, "views": 7}})
    assert (made.configs["town"].blur_px, made.configs["town"].seed) == (0.6, 3)
    assert made.configs["sfm"].mapper == "global"
    assert (made.configs["damaged"].dose, made.configs["damaged"].seed) == (0.6, 3)
    assert "damaged" in str(made.read["truth"]["sfm"].path), "what follows reads the damaged files"
    assert result.records["sfm"].metrics["views"] == 7, "and the figures that stages decide by"
    assert (result.accuracy, result.broken, result.state) == (0.6, False, "ok")
    assert [record.stage for record in result.whole] == ["sfm"] and result.records["sfm"].stage == "damaged"
    assert result.cpu_seconds == len(result.records) + 1, "what was made whole is paid for too"


@pytest.mark.parametrize(
    ("degraded", "state", "silent"),
    [("", "ok", True), ("truth", "ok", True), ("matching", "ok", True), ("sfm", "ok", True), ("similarity", "degraded", False)],
)  # fmt: skip
def test_silent_is_broken_while_no_stage_after_the_damage_says_so(
    cell, degraded: str, state: str, silent: bool
) -> None:
    later = Perturbation(
        **{**vars(IN_FACTORY), "how": InFactory("grouping", damage=Damage("sfm", f"{__name__}:scribble"))}
    )

    def says(stage: str, _config: StageConfig) -> Told:
        told = {"state": "degraded", "notes": ("doubtful",)} if stage == degraded else {}
        return told | {"metrics": {"share": 0.4}}

    result, _ = cell(later, "at once", says)
    assert result.broken and (result.state, result.silent) == (state, silent)
    assert ("similarity: doubtful" in result.notes) == (state == "degraded")


@pytest.mark.parametrize(("cause", "state"), [("refused", "refused"), ("crash", "crash"), ("memory", "crash")])
def test_a_refusal_is_no_crash(cell, cause: str, state: str) -> None:
    result, _ = cell(IN_FACTORY, "at once", lambda stage, _: {"fails": cause} if stage == "sfm" else {})
    assert (result.state, result.accuracy, result.broken, result.silent) == (state, None, True, False)
    assert "it ended" in result.failure
    computed, _ = cell(COMPUTED, "as it is", lambda stage, _: {"fails": cause})
    assert (computed.state, computed.broken) == (state, True)


@pytest.mark.parametrize("stage", ["town", "truth", "damaged"])
def test_a_stage_that_users_do_not_have_refuses_nothing_for_them(cell, stage: str) -> None:
    result, _ = cell(IN_FACTORY, "at once", lambda name, _: {"fails": "refused"} if name == stage else {})
    assert (result.state, result.broken) == ("crash", True)


def test_a_full_disk_ends_the_study(cell) -> None:
    with pytest.raises(StoreError, match=r"it ended.*\n.*to resume"):
        cell(IN_FACTORY, "at once", lambda stage, _: {"fails": "disk"})


def test_a_computed_cell_says_itself_what_a_user_would_be_told(cell) -> None:
    told = {"metrics": {"share": 0.1}, "state": "degraded", "notes": ("apart",)}
    result, made = cell(COMPUTED, "as it is", lambda *_: told)
    assert (made.configs["computed"].dose, made.configs["computed"].seed) == (0.6, 3)
    assert (result.broken, result.silent, result.notes) == (True, False, ("computed: apart",))


def test_a_figure_that_is_no_number_is_broken() -> None:
    lower = Judge("error", "lower", 1.0, "a percent")
    assert lower.broken(float("nan")) and lower.broken(None) and lower.broken(1.1)
    assert not lower.broken(1.0) and not HIGHER.broken(0.5)


def test_the_damage_is_done_to_a_copy(tmp_path: Path) -> None:
    from aug3d_core.studies.stability.config import DamageConfig

    (tmp_path / "whole").mkdir()
    (tmp_path / "whole" / "a").write_text("whole")
    (tmp_path / "out").mkdir()
    config = DamageConfig(damage=f"{__name__}:scribble", dose=0.25, seed=5)
    outcome = damage({"whole": tmp_path / "whole"}, config, tmp_path / "out", lambda *_: None)
    assert (tmp_path / "whole" / "a").read_text() == "whole"
    assert (tmp_path / "out" / "a").read_text() == f"0.25 {np.random.default_rng(5).random()}"
    assert outcome.metrics == {"dose": 0.25}


def scribble(folder: Path, dose: float, rng: np.random.Generator) -> None:
    (folder / "a").write_text(f"{dose} {rng.random()}")
