"""Runs beside each other: which settings and figures differ, by how much, and which is better where that is known."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from aug3d_core.factory.plan import stage_and_fold
from aug3d_core.factory.stages import STAGES
from aug3d_core.judging.summary import interval
from aug3d_core.metrics.flat import SUMS, flat_values, settings_of
from aug3d_core.run.metric import MetricSpec, declared, spec_of, unit_of
from aug3d_core.store.published import RULES
from aug3d_core.store.record import Record

PSNR, SSIM, OVER_CHEAP = "nvs.test_psnr_mean", "nvs.test_ssim_mean", "nvs.over_best_cheap_db"
LIMITS = ("nvs.test_psnr_ci_low", "nvs.test_psnr_ci_high")
_ABOUT = ("scene", "state", "preset", "git")
_CHEAP = "nvs.cheap_"
_OF_THE_TEST = ("nvs.", "evaluation.")
_CHANCE = 0.05  # a busy machine moves times and memory by that much
# Figures that are not of one stage: of the test over all folds, and what a run or a step cost
_OF_THE_RUN = declared(
    higher="over_best_cheap_db group_* fold_psnr_*",
    lower="seconds work_seconds cpu_seconds peak_mib",
    neither="cheap_*",
)
_COSTS = ("s", "MiB", "1/s", "1/min")


@dataclass(frozen=True)
class Side:
    """A run as it is compared: its name, what it is, its settings (as text) and its figures, both by `stage.name`.

    psnr: of each test photograph [dB], by what tells it from others, in the order of the flight; empty where not known.
    """

    name: str
    about: Mapping[str, str]
    params: Mapping[str, str]
    metrics: Mapping[str, Any]
    psnr: Mapping[str, float] = field(default_factory=dict)


@dataclass(frozen=True)
class Row:
    """A setting or figure of every run, None where a run has none.

    changes: relative to the first run, None where that cannot be said. better: whether a run is better than the first, None
    where they are the same, or where no side is known to be better.
    """

    name: str
    values: tuple[Any, ...]
    changes: tuple[float | None, ...]
    better: tuple[bool | None, ...]

    @property
    def differs(self) -> bool:
        """Whether any run has another value than the first."""
        return any(value != self.values[0] for value in self.values)


@dataclass(frozen=True)
class Gain:
    """How far a run's PSNR is above the first run's [dB]: the mean over the photographs that both were tested on, and its 95 %
    interval, None for one photograph.
    """

    photos: int
    mean_db: float
    interval_db: tuple[float, float] | None

    @property
    def sure(self) -> bool:
        """Whether it is more than chance: the interval has zero on one side."""
        return self.interval_db is not None and (self.interval_db[0] > 0 or self.interval_db[1] < 0)


@dataclass(frozen=True)
class Comparison:
    """Runs beside each other; the first is what the others are compared with.

    not_comparable: why the scores of the test say nothing about each other, "" if they do. psnr_intervals: in dB, None where
    a run has no tested model. gains: of each run over the first, photograph by photograph; None of the first, and where the
    photographs' own scores are not known. lacks: the steps of others that a run has not; they have no rows in params and
    metrics.
    """

    runs: tuple[str, ...]
    not_comparable: str
    lacks: tuple[tuple[str, ...], ...]
    psnr_intervals: tuple[tuple[float, float] | None, ...]
    gains: tuple[Gain | None, ...]
    about: tuple[Row, ...]
    headline: tuple[Row, ...]
    params: tuple[Row, ...]
    metrics: tuple[Row, ...]


def side(
    name: str, metrics: Mapping[str, Any], records: Mapping[str, Record], psnr: Mapping[str, float] | None = None
) -> Side:
    """Return a version from its `metrics.json` and the records of its steps; a step without a record tells no settings.

    psnr: as in `Side`.
    """
    stages = metrics["stages"]
    computed = sum(not figures["cached"] for figures in stages.values())
    about = {what: str(metrics[what]) for what in _ABOUT} | {"computed": f"{computed} of {len(stages)} steps"}
    if "dataset" in stages:
        about["data set"] = stages["dataset"]["digest"][:12]
    about |= {rule: metrics.get("nvs", {}).get(rule) or "" for rule in RULES}
    values = {what: value for what, value in flat_values(metrics).items() if what.rpartition(".")[2] not in RULES}
    return Side(name, about, {what: str(value) for what, value in settings_of(records).items()}, values, psnr or {})


def compare(sides: Sequence[Side], *, equal_too: bool = False) -> Comparison:
    """Compare runs with the first of them: the headline, then what differs, stage by stage; `equal_too` adds the rest.

    What is worse or better is said within one scene alone, and of the test where it was the same.
    """
    why_not = _not_comparable(sides)
    gains = tuple(None if why_not or one is sides[0] else _gain(sides[0], one) for one in sides)
    one_scene = len({one.about.get("scene") for one in sides}) == 1
    steps = [dict.fromkeys(name.partition(".")[0] for name in one.metrics if "." in name) for one in sides]
    common = {step for step in steps[0] if all(step in others for others in steps)}
    figures = _rows([one.metrics for one in sides], one_scene, not why_not)
    figures |= {name: _where_sure(figures[name], gains) for name in (PSNR, OVER_CHEAP) if name in figures}
    cheap = [name for name in figures if name.startswith(_CHEAP)]
    headline = [name for name in (PSNR, SSIM, OVER_CHEAP, *cheap, *SUMS) if name in figures]

    def shown(row: Row) -> bool:
        return row.name.partition(".")[0] in common and (equal_too or (row.differs and not _told_twice(row, figures)))

    params = _rows([one.params for one in sides], False, False)
    rest = [row for name, row in figures.items() if name not in (*headline, *LIMITS)]
    return Comparison(
        runs=tuple(one.name for one in sides),
        not_comparable=why_not,
        lacks=tuple(tuple(step for others in steps for step in others if step not in own) for own in steps),
        psnr_intervals=tuple(_interval(one) for one in sides),
        gains=gains,
        about=tuple(_rows([one.about for one in sides], False, False).values()),
        headline=tuple(figures[name] for name in headline),
        params=_by_stage(filter(shown, params.values())),
        metrics=_by_stage(filter(shown, rest)),
    )


def psnr_words(comparison: Comparison, run: int) -> str:
    """Say whether the PSNR of a run differs from the first's by more than chance; "" where nothing tells, or nothing differs.

    Paired over photographs: one is harder than another for every model, so that intervals of two means overlap long after
    their difference is sure.
    """
    gain, first, other = comparison.gains[run], comparison.psnr_intervals[0], comparison.psnr_intervals[run]
    if gain is not None:
        ends = gain.interval_db
        if not gain.mean_db and (ends is None or ends[0] == ends[1]):
            return ""
        told = f"{gain.mean_db:+.2f} dB" + ("" if ends is None else f" [{ends[0]:+.2f}, {ends[1]:+.2f}]")
        over = f"{told} over the same {gain.photos} photographs" if gain.photos > 1 else f"{told} on one photograph"
        return over if gain.sure else f"{over}, which may be chance"
    if first is not None and other is not None and first[0] <= other[1] and other[0] <= first[1]:
        return "the intervals of PSNR overlap, so the difference may be chance"
    return ""


def change_text(row: Row, run: int) -> str:
    """Return how far a run is from the first: in dB where the figure is, in percent elsewhere; "" where it is the same."""
    first, value, change = row.values[0], row.values[run], row.changes[run]
    if change is None or value == first:
        return ""
    if _spec(row.name).unit == "dB":
        return f"{value - first:+.2f} dB"
    percent = 100 * change
    return f"{percent:+.0f} %" if abs(percent) >= 10 else f"{percent:+.2g} %"


def _rows(tables: Sequence[Mapping[str, Any]], judged: bool, test_judged: bool) -> dict[str, Row]:
    return {
        name: _row(
            name, [table.get(name) for table in tables], test_judged if name.startswith(_OF_THE_TEST) else judged
        )
        for name in dict.fromkeys(name for table in tables for name in table)
    }


def _gain(first: Side, other: Side) -> Gain | None:
    if not first.psnr or first.psnr.keys() != other.psnr.keys():
        return None
    over_db = np.array([psnr - first.psnr[photo] for photo, psnr in other.psnr.items()])
    return Gain(len(over_db), float(over_db.mean()), interval(over_db))


def _where_sure(row: Row, gains: Sequence[Gain | None]) -> Row:
    """Return the row of PSNR, or of its lead, without a verdict where photograph by photograph the difference may be chance."""
    better = (said if gain is None or gain.sure else None for said, gain in zip(row.better, gains, strict=True))
    return replace(row, better=tuple(better))


def _told_twice(row: Row, figures: Mapping[str, Row]) -> bool:
    """Say whether a figure of the first fold's test is one over all folds as well."""
    step, _, name = row.name.partition(".")
    over_all = figures.get(f"nvs.{name}")
    return step == "evaluation" and over_all is not None and over_all.values == row.values


def _row(name: str, values: Sequence[Any], judged: bool) -> Row:
    higher = _higher_is_better(name) if judged else None
    changes = tuple(_change(values[0], value) for value in values)
    better = tuple(_better(name, values[0], value, higher) for value in values)
    return Row(name, tuple(values), changes, better)


def _better(name: str, first: Any, value: Any, higher: bool | None) -> bool | None:
    if higher is None or not _number(first) or not _number(value) or value == first:
        return None
    if _spec(name).unit in _COSTS and abs(value - first) <= _CHANCE * abs(first):
        return None
    return (value > first) == higher


def _number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)


def _change(first: Any, value: Any) -> float | None:
    return (value - first) / abs(first) if _number(first) and _number(value) and first else None


def _higher_is_better(name: str) -> bool | None:
    if name == SUMS[0]:  # it depends on what was cached
        return None
    better = _spec(name).better
    return None if better is None else better == "higher"


def _spec(name: str) -> MetricSpec:
    """Return what a figure means, by `stage.name`; figures of the test over all folds are called as those of one."""
    step, _, figure = name.rpartition(".")
    stage = STAGES.get("evaluation" if step == "nvs" else stage_and_fold(step)[0])
    found = spec_of(figure, stage.metrics) if stage else None
    return found or spec_of(figure, _OF_THE_RUN) or MetricSpec(unit_of(figure), None)


def _not_comparable(sides: Sequence[Side]) -> str:
    without = [one.name for one in sides if PSNR not in one.metrics]
    if without:
        return f"{', '.join(without)}: no tested model"
    unknown = [one.name for one in sides if not all(one.about.get(rule) for rule in RULES)]
    if unknown:
        return f"{', '.join(unknown)}: not known on which photographs and by which rules it was tested"
    if len({one.about.get("test_photos") for one in sides}) > 1:
        return "other test photographs"
    if len({one.about.get("conventions") for one in sides}) > 1:
        return "tested by other rules"
    return ""


def _interval(one: Side) -> tuple[float, float] | None:
    low, high = (one.metrics.get(name) for name in LIMITS)
    return None if low is None or high is None else (low, high)


def _by_stage(rows: Iterable[Row]) -> tuple[Row, ...]:
    order = {stage: place for place, stage in enumerate(STAGES)}

    def place(row: Row) -> tuple[int, int]:
        stage, fold = stage_and_fold(row.name.partition(".")[0])
        return fold, order.get(stage, -1)  # first what is over all folds

    return tuple(sorted(rows, key=place))
