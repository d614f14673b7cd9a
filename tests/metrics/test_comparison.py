"""Runs beside each other: what differs is all that is shown, and what is better is said only where it is known."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import asdict, replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from aug3d_core.factory.stages import FROM_TOWN
from aug3d_core.metrics.comparison import PSNR, Comparison, Gain, Row, Side, change_text, compare, psnr_words, side
from aug3d_core.metrics.flat import flat_metrics, flat_values, headline


def metrics(psnr: float = 20.0, **changed: Any) -> dict[str, Any]:
    """Return the figures of a run of two stages as `metrics.json` holds them."""

    def stage(**figures: Any) -> dict[str, Any]:
        return {"seconds": 10.0, "peak_mib": 100.0, "cached": False, "digest": "d", "metrics": figures}

    return {
        "scene": "town", "state": "ok", "preset": "tiny", "git": "abc", "seconds": 20.0, "peak_mib": 100.0,
        "stages": {
            "sfm": stage(reprojection_px=0.5, registered=10, mapper="incremental"),
            "evaluation": stage(test_psnr_mean=psnr, conventions="c"),
        },
        "nvs": {
            "test_psnr_mean": psnr, "test_psnr_ci": [psnr - 1, psnr + 1], "test_ssim_mean": 0.5, "test_photos": "p",
            "conventions": "c", "groups": {"best": psnr}, "cheap": {"mean_colour": 15.0, "mesh_render": None},
            "fold_psnr_means": [psnr],
        },
    } | changed  # fmt: skip


def town(name: str = "town", params: dict[str, str] | None = None, **changed: Any) -> Side:
    made = side(name, metrics(**changed), {})
    return Side(name, made.about, params or {}, made.metrics)


def rows(found: Comparison) -> dict[str, Row]:
    return {row.name: row for row in (*found.headline, *found.params, *found.metrics)}


def changed(one: Side, **values: Any) -> Side:
    return Side(
        one.name, one.about, one.params, {**one.metrics, **{k.replace("__", "."): v for k, v in values.items()}}
    )


def test_every_figure_has_a_flat_name_and_the_headline_is_among_them() -> None:
    flat = flat_values(metrics())
    assert flat["sfm.mapper"] == "incremental" and flat["work_seconds"] == 20
    assert flat["nvs.test_psnr_ci_low"] == 19 and flat["nvs.cheap_mean_colour"] == 15
    assert flat["nvs.over_best_cheap_db"] == 5 and flat["nvs.group_best"] == 20
    assert "nvs.fold_psnr_means" not in flat
    assert headline(metrics()).items() <= flat_metrics(metrics()).items()
    assert {"sfm.reprojection_px", "sfm.seconds", PSNR, "nvs.cheap_mean_colour"} <= headline(metrics()).keys()
    assert "sfm.registered" not in headline(metrics())


def test_a_run_and_itself_differ_in_nothing() -> None:
    found = compare([town(), town()])
    assert found.params == found.metrics == () and found.not_comparable == ""
    assert not any(row.differs for row in found.headline)
    every = compare([town(params={"sfm.a": "1"}), town(params={"sfm.a": "1"})], equal_too=True)
    assert [row.name for row in every.params] == ["sfm.a"] and len(every.metrics) > 5


def test_a_setting_that_differs_is_shown_and_no_other() -> None:
    found = compare([town(params={"sfm.a": "1", "sfm.b": "2"}), town(params={"sfm.a": "1", "sfm.b": "3"})])
    assert [(row.name, row.values, row.better) for row in found.params] == [("sfm.b", ("2", "3"), (None, None))]


@pytest.mark.parametrize(
    ("name", "first", "second", "better"),
    [
        (PSNR, 20.0, 21.0, True),
        ("nvs.over_best_cheap_db", -1.0, -2.0, False),
        ("sfm.reprojection_px", 0.5, 0.6, False),
        ("sfm.registered", 10, 12, True),
        ("sfm.peak_mib", 100.0, 50.0, True),
        ("sfm.seconds", 10.0, 10.4, None),  # a busy machine does as much
        ("seconds", 20.0, 10.0, None),  # it tells what was cached
        ("nvs.cheap_mean_colour", 15.0, 16.0, None),  # the model is no better for that
        ("sfm.mapper", "incremental", "global", None),
        ("sfm.points", 10, 20, None),
        ("sfm.registered", 10, None, None),
    ],
)
def test_what_is_better_is_said_where_it_is_known(name: str, first: Any, second: Any, better: bool | None) -> None:
    found = compare([changed(town(), **{name: first}), changed(town(), **{name: second})])
    assert rows(found)[name].better == (None, better)


@pytest.mark.parametrize(
    ("part", "value", "why"), [("test_photos", "q", "photographs"), ("conventions", "d", "other rules")]
)
def test_scores_of_another_test_are_not_judged_and_costs_are(part: str, value: str, why: str) -> None:
    other = metrics(30.0)
    other["nvs"][part] = value
    found = compare([town(), changed(side("b", other, {}), sfm__seconds=5.0)])
    assert why in found.not_comparable
    assert rows(found)[PSNR].better == (None, None) and rows(found)["sfm.seconds"].better == (None, True)


@pytest.mark.parametrize("part", ["test_photos", "conventions"])
def test_runs_whose_test_is_not_known_are_not_judged(part: str) -> None:
    one, other = metrics(20.0), metrics(30.0)
    del one["nvs"][part], other["nvs"][part]
    found = compare([side("a", one, {}), side("b", other, {})])
    assert found.not_comparable.startswith("a, b: not known") and rows(found)[PSNR].better == (None, None)


def test_a_run_without_a_test_has_no_score_to_compare() -> None:
    failed = metrics()
    del failed["nvs"], failed["stages"]["evaluation"]
    found = compare([town(), side("begun", failed, {})])
    assert found.not_comparable == "begun: no tested model"
    assert found.lacks == ((), ("evaluation", "nvs")) or found.lacks == ((), ("nvs", "evaluation"))
    assert found.psnr_intervals == ((19, 21), None) and not psnr_words(found, 1)


def test_nothing_is_better_or_worse_in_another_scene() -> None:
    found = compare([town(), town("lake", scene="lake", peak_mib=1.0)])
    assert all(row.better == (None, None) for row in rows(found).values())


@pytest.mark.parametrize(("psnr", "chance"), [(21.5, True), (22.5, False), (17.0, False)])
def test_intervals_that_overlap_may_be_chance(psnr: float, chance: bool) -> None:
    assert ("may be chance" in psnr_words(compare([town(), town(psnr=psnr)]), 1)) == chance


def scored(gained_db: Sequence[float], **changed: Any) -> Side:
    """Return a run whose ten photographs differ by 2 dB from each other, and by `gained_db` from those of other runs."""
    return replace(town(**changed), psnr={str(i): 20.0 + 2 * i + gain for i, gain in enumerate(gained_db)})


def test_photographs_tell_what_intervals_of_means_do_not() -> None:
    before = scored(np.zeros(10))
    found = compare([before, scored(np.linspace(0.4, 0.6, 10), psnr=20.5)])
    gain = found.gains[1]
    assert found.gains[0] is None and gain is not None and gain.sure
    assert gain.mean_db == pytest.approx(0.5) and gain.photos == 10
    assert "chance" not in psnr_words(found, 1) and "+0.50 dB [+0.4" in psnr_words(found, 1)
    assert rows(found)[PSNR].better == (None, True)


@pytest.mark.parametrize("gained_db", [np.linspace(-1.0, 2.0, 10), [0.5]])
def test_a_gain_that_may_be_chance_is_no_verdict(gained_db: Sequence[float]) -> None:
    found = compare([scored(np.zeros(len(gained_db))), scored(gained_db, psnr=20.5)])
    assert psnr_words(found, 1).endswith("which may be chance")
    assert rows(found)[PSNR].better == rows(found)["nvs.over_best_cheap_db"].better == (None, None)


def test_the_order_of_photographs_does_not_matter_and_equal_ones_need_no_word() -> None:
    before = scored(np.zeros(10))
    turned = replace(before, psnr=dict(reversed(before.psnr.items())))
    assert compare([before, turned]).gains[1] == Gain(10, 0.0, (0.0, 0.0)) and not psnr_words(
        compare([before, turned]), 1
    )


def test_photographs_of_another_test_are_not_paired() -> None:
    before, other = scored(np.zeros(10)), scored(np.ones(10), nvs=metrics()["nvs"] | {"test_photos": "q"})
    assert compare([before, other]).gains == (None, None)
    assert compare([before, scored(np.ones(9))]).gains == (None, None)
    assert compare([before, town()]).gains == (None, None)


@pytest.mark.parametrize(
    ("name", "first", "second", "text"),
    [
        (PSNR, 20.0, 20.5, "+0.50 dB"),
        ("nvs.cheap_mean_colour", 15.0, 14.0, "-1.00 dB"),
        ("evaluation.cheap_mean_colour_ssim", 0.5, 0.4, "-20 %"),
        ("evaluation.cheap_mean_colour_flip", 0.3, 0.24, "-20 %"),
        ("evaluation.over_guided_blend_ci_low", 0.02, -0.3, "-0.32 dB"),
        ("sfm.points", 1000, 1500, "+50 %"),
        ("sfm.points", 1000, 1015, "+1.5 %"),
        ("sfm.points", 0, 5, ""),
        ("sfm.points", 5, 5, ""),
        ("sfm.mapper", "a", "b", ""),
    ],
)
def test_a_change_is_told_in_its_unit(name: str, first: Any, second: Any, text: str) -> None:
    found = compare([changed(town(), **{name: first}), changed(town(), **{name: second})], equal_too=True)
    assert change_text(rows(found)[name], 1) == text


def test_figures_stand_in_the_order_of_the_stages_and_folds_come_last() -> None:
    names = [f"{stage.name}.x" for stage in FROM_TOWN]
    figures = dict.fromkeys([f"{names[-1].partition('.')[0]}_fold1.x", *reversed(names), "nvs.y"], 1)
    other = dict.fromkeys(figures, 2)
    found = compare([Side("a", {}, {}, figures), Side("b", {}, {}, other)])
    assert [row.name for row in found.metrics] == ["nvs.y", *names, "evaluation_fold1.x"]


@given(
    st.lists(
        st.dictionaries(st.sampled_from("abcde"), st.floats(allow_nan=False) | st.integers() | st.text()), min_size=2
    )
)
def test_what_is_shown_differs_and_what_differs_is_shown(tables: list[dict[str, Any]]) -> None:
    sides = [
        Side(str(n), {}, {}, {"sfm.always": 0} | {f"sfm.{k}": v for k, v in t.items()}) for n, t in enumerate(tables)
    ]
    shown = {row.name for row in compare(sides).metrics}
    differing = {f"sfm.{k}" for k in "abcde" if any(t.get(k) != tables[0].get(k) for t in tables)}
    assert shown == differing


def test_it_is_json() -> None:
    assert json.loads(json.dumps(asdict(compare([town(), town(psnr=21.0)]))))["runs"] == ["town", "town"]
