"""The chart and the sentences of the paper's edge cases, from made-up results."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from PIL import Image

from aug3d_core.store import layout
from aug3d_core.store.store import Store
from aug3d_core.studies.common.cell import Cell
from aug3d_core.studies.common.trial import Trial
from aug3d_core.studies.common.write import write_study
from aug3d_core.studies.stability.cell import Dosed, StabilityResult
from aug3d_core.studies.stability.edge_story import draw, sentences
from aug3d_core.studies.stability.findings import StabilityFindings, findings
from aug3d_core.studies.stability.page import publication
from aug3d_core.studies.stability.perturbations.edge_cases import PERTURBATIONS

TURNS = next(p for p in PERTURBATIONS if p.name == "abrupt turns")


def found(bad: Mapping[str, float]) -> StabilityFindings:
    """Return results whose bad members grow with the dose, by so much a turn; below 0 there is no figure."""
    cells = [Cell(Dosed(TURNS, dose, way), seed) for way in bad for dose in TURNS.doses for seed in (0, 1, 2)]

    def figure(cell: Cell[Dosed]) -> float | None:
        return min(1.0, bad[cell.arm.method] * cell.arm.dose + 0.01 * cell.seed) if bad[cell.arm.method] >= 0 else None

    return findings("full", 3, "", [StabilityResult(c, Trial({}), figure(c), "ok") for c in cells])


def test_a_case_is_told_with_numbers() -> None:
    (sentence,) = sentences(found({"sequence": 0.2, "shared": 0.0}))
    assert "changes of course" in sentence
    assert (
        "sequence breaks at 1.25 turns in ten photos (51% of its members are bad at 2.5 turns in ten photos)"
        in sentence
    )
    assert "shared never breaks (at most 1% of its members are bad)" in sentence


def test_a_case_that_was_not_run_is_not_told_of(tmp_path: Path) -> None:
    assert sentences(found({"grid": 0.1})) == []
    nothing = findings("chosen", 1, "", [])
    assert sentences(nothing) == [] and not draw(nothing, tmp_path / "chart.png")
    assert not (tmp_path / "chart.png").exists()


def test_the_page_shows_the_chart_and_says_the_sentence(tmp_path: Path) -> None:
    store = Store(tmp_path)
    folder = write_study(store, publication(store, found({"sequence": 0.2, "shared": 0.0})))
    text = (folder / layout.STUDY_PAGE).read_text()
    assert "with numbers" in text and "sequence breaks at 1.25 turns" in text


def test_the_chart_has_a_line_for_each_way_that_has_a_figure(tmp_path: Path) -> None:
    assert draw(found({"sequence": 0.2, "grid": -1.0, "shared": 0.0}), tmp_path / "chart.png")
    with Image.open(tmp_path / "chart.png") as image:
        colours = {colour for _, colour in image.convert("RGB").getcolors(1 << 20) or []}
    assert {(0xB4, 0x53, 0x09), (0x15, 0x80, 0x3D)} <= colours
