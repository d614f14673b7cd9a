"""Each scene is left out of what its model is trained on, and ways are compared photograph by photograph."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from aug3d_core.collections.entry import CollectionEntry
from aug3d_core.collections.made import make_data
from aug3d_core.factory.build import Built
from aug3d_core.factory.walk import Visit
from aug3d_core.heads.files import MODEL_WEIGHTS
from aug3d_core.scene_files import SceneEntry
from aug3d_core.store.store import Store
from aug3d_core.studies.common.cell import Cell, make_cells
from aug3d_core.studies.common.trial import Trial
from aug3d_core.studies.common.write import write_study
from aug3d_core.studies.generalisation.cells import Generalised, LeftOut, cells_of, make_cell
from aug3d_core.studies.generalisation.findings import Lead, findings
from aug3d_core.studies.generalisation.page import publication
from tests.collections.stand_in import Stages
from tests.stand_in_stages import Made, write_test

ENTRY = CollectionEntry(train=("north", "south"), hold_out=("far",), towns=1, settings={"training": {"steps": 200}})
SCENES = {
    name: SceneEntry(photos=None, settings={"town": {"seed": n}}) for n, name in enumerate(("north", "south", "far"))
}


class Learning(Stages):
    """A model is better the more it is trained, and by one dB on places that it has seen."""

    def __init__(self) -> None:
        super().__init__()
        self.trained: list[tuple[set[str], int, str]] = []  # on what, steps, start

    def figures(self, stage, made: Made, files: Path):
        if stage.name == "training":
            settings = made["training"]
            (files / MODEL_WEIGHTS).write_text(f'{{"of training": {len(self.trained)}}}')
            self.trained.append((self.given["training"], settings["steps"], settings["head"].get("start", "")))
        if stage.name == "evaluation":
            better = 1.0 if "file" in made["training"]["head"].get("start", "") else 0.0
            write_test(files, {1: 20.0 + better, 2: 22.0 + better, 3: 24.0 + better}, others=19.0)
        if stage.name == "preview":
            return {"over_best_cheap_db": 1.5}
        return super().figures(stage, made, files)


@pytest.fixture
def studied(tmp_path: Path):
    store, stages = Store(tmp_path), Learning()
    make = stages.maker(store)
    made = make_data(store, ENTRY, SCENES, lambda of: make)
    cells = cells_of(ENTRY, ("sweep",), 1)
    results = make_cells(store, cells, lambda cell: make_cell(store, ENTRY, made, cell, make), lambda *_: None)
    return store, stages, results


def test_every_scene_is_left_out_of_its_training(studied):
    _, stages, results = studied
    assert len(results) == 9 and not any(result.failure for result in results)
    town = "town-0-00000"
    wanted = {
        frozenset(on)
        for on in (
            {"south", "far", town},
            {"north", "far", town},
            {"north", "south", town},
            {"north"},
            {"south"},
            {"far"},
        )
    }
    assert {frozenset(on) for on, *_ in stages.trained} == wanted


def test_a_model_is_tuned_from_the_one_that_never_saw_the_scene_for_a_tenth_of_the_steps_of_one_alone(studied):
    _, stages, _ = studied
    tuned = [(on, steps, start) for on, steps, start in stages.trained if start.endswith(".safetensors")]
    assert [on for on, *_ in tuned] == [{"north"}, {"south"}, {"far"}]
    assert {steps for _, steps, _ in tuned} == {240}
    assert {steps for on, steps, start in stages.trained if start == "random"} == {2400}


def test_in_folds_no_model_is_judged_on_what_it_was_trained_on(tmp_path: Path):
    store, stages = Store(tmp_path), Learning()
    stages.folds = 2
    made_by, given = stages.maker(store), {}

    def make(visit: Visit) -> Built | None:
        built = made_by(visit)
        if built and visit.work:
            given[built.record.key] = {source.digest for source in visit.work.sources.values()}
        return built

    made = make_data(store, ENTRY, SCENES, lambda of: make)
    cells = [cell for cell in cells_of(ENTRY, ("sweep",), 1) if cell.arm.scene == "north"]
    results = make_cells(store, cells, lambda cell: make_cell(store, ENTRY, made, cell, make), lambda *_: None)
    folds = [record.digest for record in made.members["north"].data.values()]
    for result in results:
        assert not result.failure and result.views is not None and len(result.views) == 6
        for fold, after in enumerate(("", "_fold1")):
            trained = result.records["training" if result.arm.way == "never seen" else f"training{after}"]
            assert given[result.records[f"evaluation{after}"].key] == {folds[fold], trained.digest}
            own = set() if result.arm.way == "never seen" else {folds[fold]}
            assert given[trained.key] & set(folds) == own


def test_ways_are_compared_photograph_by_photograph(studied):
    _, _, results = studied
    found = findings("all", 1, "a machine", results)
    assert len(found.rows) == 9
    lead = found.against["north: plane sweep tuned over alone, about the scaffold"]
    assert (lead.mean, lead.low, lead.high) == pytest.approx((1.0, 1.0, 1.0))
    assert found.rows[0].over["plane_sweep"].mean == pytest.approx(3.0)


@pytest.mark.parametrize("lost", [(), (0,), (0, 2), (0, 1, 2)])
def test_ways_are_compared_seed_by_seed(tmp_path: Path, lost: tuple[int, ...]):
    results = [
        Generalised(Cell(LeftOut("north", way, "sweep"), seed), Trial({}), write_test(tmp_path, {1: level, 2: level}))
        for seed, level in enumerate((18.0, 22.0, 26.0))  # seeds differ more than ways
        for way, level in (("tuned", level + 1), ("alone", level))
        if way == "alone" or seed not in lost
    ]
    against = findings("all", 3, "a machine", results).against
    assert len(against) == (0 if len(lost) == 3 else 2)
    assert all(lead.mean == pytest.approx(1.0) for lead in against.values())


def test_a_model_that_fails_without_a_warning_is_a_silent_failure(studied):
    _, stages, results = studied
    found = findings("all", 1, "a machine", results)
    assert stages.given["preview"] == {"sfm", "training"}
    foreseen = [row for row in found.rows if row.foreseen_db is not None]
    assert {(row.way, row.foreseen_db, row.warned) for row in foreseen} == {("never seen", 1.5, False)}
    assert len(foreseen) == 3 and found.silent == []
    poor = replace(foreseen[0], over={**foreseen[0].over, "plane_sweep": Lead(-0.1, -0.5, 0.3)})
    assert poor.silent and not replace(poor, warned=True).silent
    assert replace(found, rows=[poor]).as_json()["silent"] == ["north, plane sweep"]


def test_it_is_written_with_chart_and_page(studied):
    store, _, results = studied
    folder = write_study(store, publication(findings("all", 1, "a machine", results)))
    page = (folder / "study.html").read_text()
    assert all(text in page for text in ("never seen", "tuned", "alone", "plane sweep", "south"))
    assert (folder / "chart.png").stat().st_size > 1000


def test_a_scene_that_was_not_made_fails_alone(tmp_path: Path):
    store, stages = Store(tmp_path), Learning()
    stages.fails = lambda stage, made: "error: no luck" if stage == "sfm" and made["town"]["seed"] == 1 else ""
    make = stages.maker(store)
    made = make_data(store, ENTRY, SCENES, lambda of: make)
    cells = cells_of(ENTRY, ("sweep",), 1)
    results = make_cells(store, cells, lambda cell: make_cell(store, ENTRY, made, cell, make), lambda *_: None)
    assert {result.arm.scene for result in results if result.failure} == {"south"}
    assert findings("all", 1, "m", results).failed


def test_a_head_that_cannot_start_from_weights_is_not_tuned():
    ways = [cell.arm.way for cell in cells_of(ENTRY, ("pixelnerf",), 2)]
    assert "tuned" not in ways and ways.count("alone") == 6
