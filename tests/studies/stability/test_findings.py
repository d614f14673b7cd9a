"""What cells say together: where a method breaks, what is silent, and what is written for people and programs."""

from __future__ import annotations

import json
from pathlib import Path

import pandas as pd
import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from PIL import Image

from aug3d_core.run.errors import UsageError
from aug3d_core.run.files import FILES
from aug3d_core.store import layout
from aug3d_core.store.record import Record
from aug3d_core.store.store import Store
from aug3d_core.studies.common.cell import Cell
from aug3d_core.studies.common.trial import Trial
from aug3d_core.studies.common.write import write_study
from aug3d_core.studies.stability.catalogue import PERTURBATIONS, cells_of, chosen
from aug3d_core.studies.stability.cell import CellState, Dosed, StabilityResult
from aug3d_core.studies.stability.findings import StabilityFindings, as_json, findings
from aug3d_core.studies.stability.map import margin
from aug3d_core.studies.stability.page import publication
from aug3d_core.studies.stability.perturbation import Computed, Judge, Perturbation

JUDGE = Judge("share", "higher", 0.5, "half is wrong")
WORSE = Perturbation(
    "rain", "Photographs", "It rains.", "mm", (0, 1, 2, 3), JUDGE, Computed("a:b"), {"bare": (), "under a roof": ()}
)


def cell(
    dose: float,
    method: str,
    seed: int,
    accuracy: float | None,
    state: CellState = "ok",
    failure: str = "",
    said: tuple[str, ...] = (),
    **records: Record,
) -> StabilityResult:
    return StabilityResult(Cell(Dosed(WORSE, dose, method), seed), Trial(records, failure), accuracy, state, said)


def studied(*results: StabilityResult) -> StabilityFindings:
    return findings("full", 3, "a machine", results)


def test_a_method_breaks_at_the_first_dose_at_which_half_of_its_seeds_do() -> None:
    found = studied(
        *(cell(0, "bare", seed, 0.9) for seed in range(3)),
        *(cell(1, "bare", seed, accuracy) for seed, accuracy in enumerate((0.4, 0.6, 0.7))),
        *(cell(2, "bare", seed, accuracy, "degraded") for seed, accuracy in enumerate((None, 0.3, 0.7))),
        *(cell(0, "under a roof", seed, 0.9) for seed in range(3)),
    )
    bare, roof = found.rows
    assert bare.breaking is not None and (bare.breaking.dose, bare.breaking.state) == (2, "degraded")
    assert bare.noticed is bare.breaking and bare.breaking.accuracy == pytest.approx(0.3), "no figure is the worst"
    assert roof.breaking is None and roof.noticed is None
    assert [(r.arm.dose, r.seed) for r in found.silent] == [(1, 0)], "one seed is silent, though the method holds"


def test_alarms_and_crashes_are_counted_apart() -> None:
    found = studied(
        cell(0, "bare", 0, 0.9, "degraded"),
        cell(3, "bare", 0, 0.9, "degraded"),
        cell(3, "under a roof", 0, None, "crash", failure="SIGSEGV"),
    )
    assert [r.arm.dose for r in found.false_alarms] == [0], "an alarm at a dose that does no harm has no cause"
    assert len(found.crashes) == 1 and not found.silent
    told = as_json(found)
    assert (told["cells"], told["silent_failures"], told["crashes"]) == (3, 0, 1)


@given(st.floats(0.01, 100), st.floats(0, 100), st.floats(0, 100), st.sampled_from(("higher", "lower")))
@example(2.0, 0.0, 5e-324, "higher")
def test_the_colour_turns_at_the_mark_and_the_better_is_never_paler(
    mark: float, accuracy: float, other: float, better
) -> None:
    judge = Judge("f", better, mark, "")
    assert -1 <= margin(judge, accuracy) <= 1
    low, high = sorted((accuracy, other))
    rise = margin(judge, high) - margin(judge, low)
    assert rise >= 0 if better == "higher" else rise <= 0
    assert (margin(judge, accuracy) < 0) == judge.broken(accuracy)
    assert margin(judge, None) == -1


@given(st.floats(-3, 3))
def test_the_colour_of_a_mark_of_zero_is_the_sign(accuracy: float) -> None:
    for better in ("higher", "lower"):
        judge = Judge("f", better, 0.0, "")
        assert (margin(judge, accuracy) < 0) == judge.broken(accuracy)


def test_what_is_written_shows_the_failure_and_what_the_factory_said(tmp_path: Path) -> None:
    store = Store(tmp_path)
    files = store.work_dir("computed", "k") / FILES
    files.mkdir(parents=True)
    Image.new("RGB", (40, 30), "red").save(files / "wet.png")
    empty = {"recipe": "r", "inputs": {}, "versions": {}, "series": {}, "notes": (), "config": {}, "metrics": {}}
    loose = {"pictures": {"Wet": "wet.png"}, "state": "ok", "seconds": 2.0, "cpu_seconds": 1.0, "peak_mib": 1.0}
    record: Record = store.commit(files.parent, "computed", "k", empty | loose)
    found = studied(
        cell(0, "bare", 0, 0.9, computed=record),
        cell(2, "bare", 0, 0.2, computed=record),
        cell(2, "under a roof", 0, None, "refused", failure="too <wet>", said=("too <wet>",)),
    )
    folder = write_study(store, publication(store, found))
    page = (folder / layout.STUDY_PAGE).read_text()
    assert "http" not in page and page.count("data:image") == 3, "the map, the harmless dose, the failure"
    assert "too &lt;wet&gt;" in page and "Silent failures" in page and "<wet>" not in page
    told = json.loads((folder / layout.STUDY_FINDINGS).read_text())
    assert told["breaking_doses"][0]["breaking_dose"] == 2 and told["seconds"] == 2.0, "an object counts once"
    assert len(pd.read_parquet(folder / layout.STUDY_SCORES)) == 3


def test_cells_are_seed_after_seed_and_the_quick_size_is_two_doses() -> None:
    cells = cells_of([WORSE], 2, False)
    assert len(cells) == 2 * 2 * 4 and [c.seed for c in cells] == sorted(c.seed for c in cells)
    assert [c.arm.dose for c in cells_of([WORSE], 1, True)] == [0, 3, 0, 3]
    assert 0 < len(chosen((), True)) < len(chosen((), False)) == len(PERTURBATIONS)


def test_a_perturbation_that_is_not_there_is_named_with_those_that_are() -> None:
    assert {p.name for p in chosen(("Slope",), False)} >= {"slope", "village on a slope"}
    with pytest.raises(UsageError, match=r"no perturbation 'snow'[\s\S]*blur"):
        chosen(("Slope", "snow"), False)
    # Words are given from their start: this is not "training in the dark"
    with pytest.raises(UsageError, match="no perturbation 'rain'"):
        chosen(("rain",), False)
