"""The findings of a study as data, for the page and programs."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import pandas as pd

from aug3d_core.store.usage import named
from aug3d_core.studies.tradeoff.arm import REFUSED, TradeoffResult
from aug3d_core.studies.tradeoff.point import Point, below, cheapest, on_front, points
from aug3d_core.studies.tradeoff.study import TradeoffFindings


def as_json(found: TradeoffFindings, machine: str) -> dict[str, Any]:
    """Return the findings for programs; ratios and regrets are None where there is nothing to compare."""
    failed = [result for result in found.results if result.failure]
    return {
        "name": "tradeoff",
        "scene": found.scene.name,
        "preset": found.scene.own.preset,
        "settings": list(found.scene.own.overrides),
        "machine": machine,
        "cache": cache(found.results),
        "quick": found.quick,
        "seeds": found.seeds,
        "test_photos": found.test_photos,
        "runs": len(found.results),
        "failed_runs": len(failed),
        "crashes": crashes(found),
        "target_db": found.target_db,
        "best": _point(found.best),
        "chosen": _point(found.chosen),
        "auto": _point(found.auto),
        "decisions": decisions(found),
        **against_best(found),
        "search": _search(found),
        **search_against_grid(found),
        "points": [_point(point) for point in found.points],
        "cells": [result.as_json() for result in found.results],
        "objects": named(record for result in found.results for record in result.used),
    }


def against_best(found: TradeoffFindings) -> dict[str, float | None]:
    """Return how far `auto` is below the best configuration [dB], with the interval, and the ratio of their processor times."""
    best, auto = found.best, found.auto
    regret = None if best is None or auto is None else below(auto, best)
    if best is None or auto is None or regret is None or not best.cpu_seconds:
        return dict.fromkeys(("auto_regret_db", "auto_regret_low_db", "auto_regret_high_db", "auto_time_ratio"))
    low, high = regret.interval or (None, None)
    return {
        "auto_regret_db": regret.db,
        "auto_regret_low_db": low,
        "auto_regret_high_db": high,
        "auto_time_ratio": auto.cpu_seconds / best.cpu_seconds,
    }


def search_against_grid(found: TradeoffFindings) -> dict[str, float | None]:
    """Compare the search with the cheapest configuration of the grid that reaches the target, with one seed.

    search_cost_ratio: cost of the whole search over the cost of that configuration.
    search_found_ratio: cost of the configuration that the search found over the same.
    search_regret_db: how far that one is below it [dB].
    Without the full grid, the cost of the search is compared with what it found.
    """
    if found.search is None or found.search.found is None:
        return dict.fromkeys(("search_cost_ratio", "search_found_ratio", "search_regret_db"))
    ended = found.search.found
    spent_s, ended_s = found.search.spent_s, ended.tried.cost_s
    grid = points(
        [result for result in found.results if result.seed == 0 and result.arm in {p.arm for p in found.factory}]
    )
    choice = None if found.searched_only else cheapest(grid, found.search.target_db)
    if choice is None or choice.accuracy is None:
        spent = spent_s / ended_s if ended_s else None
        return {"search_cost_ratio": spent, "search_found_ratio": None, "search_regret_db": None}
    return {
        "search_cost_ratio": spent_s / choice.cpu_seconds if choice.cpu_seconds else None,
        "search_found_ratio": ended_s / choice.cpu_seconds if choice.cpu_seconds else None,
        "search_regret_db": max(0.0, choice.accuracy - ended.psnr_db),
    }


def crashes(found: TradeoffFindings) -> int:
    """Return the number of runs that crashed or failed for another reason than a refusal of their settings."""
    return sum(bool(r.failure) and r.trial.cause != REFUSED for r in found.results)


def cache(results: Sequence[TradeoffResult]) -> dict[str, int]:
    """Return the number of outputs of all runs, and how many existed before the study (with the times of back then)."""
    return {"outputs": sum(len(r.records) for r in results), "found_made": sum(r.found for r in results)}


def decisions(found: TradeoffFindings) -> list[dict[str, Any]]:
    """Return the decisions of `auto`."""
    return [one.model_dump() for one in found.auto.results[0].trial.decisions] if found.auto else []


def table(found: TradeoffFindings) -> pd.DataFrame:
    """Return one row per run."""
    on_fronts = {p.arm for panel in panels(found) for p in on_front(panel)}
    comparable = {point.arm: point.comparable for point in found.points}
    return pd.DataFrame([
        {
            "scene": found.scene.name, "panel": r.arm.panel, "label": r.arm.label, "settings": " ".join(r.arm.settings),
            "mark": r.arm.mark, "seed": r.seed, "seconds": r.seconds, "cpu_seconds": r.cpu_seconds,
            "peak_mib": r.peak_mib, "size_bytes": r.size_bytes, "accuracy": r.accuracy,
            "accuracy_name": r.arm.judge.name, "low": (r.interval or (None, None))[0],
            "high": (r.interval or (None, None))[1], "comparable": comparable[r.arm], "on_front": r.arm in on_fronts,
            "chosen": found.chosen is not None and r.arm == found.chosen.arm, "found_objects": r.found,
            "failure": r.failure, "cause": r.trial.cause,
            **{f"cpu_seconds_{stage}": cost for stage, cost in r.costs.items()},
        }
        for r in found.results
    ])  # fmt: skip


def panels(found: TradeoffFindings) -> list[list[Point]]:
    """Return the points panel by panel, the whole factory first."""
    by_panel: dict[str, list[Point]] = {p.arm.panel: [] for p in [*found.factory, *found.points]}
    for point in found.points:
        by_panel[point.arm.panel].append(point)
    return list(by_panel.values())


def _point(point: Point | None) -> dict[str, Any] | None:
    if point is None:
        return None
    return {
        "panel": point.arm.panel,
        "label": point.arm.label,
        "settings": list(point.arm.settings),
        "mark": point.arm.mark,
        "seeds": len(point.results),
        "cpu_seconds": point.cpu_seconds,
        "accuracy": point.accuracy,
        "accuracy_name": point.arm.judge.name,
        "comparable": point.comparable,
    }


def _search(found: TradeoffFindings) -> dict[str, Any] | None:
    if found.search is None:
        return None
    ended = found.search.found
    return {
        "target_db": found.search.target_db,
        "reached": found.search.reached is not None,
        "spent_s": found.search.spent_s,
        "found": ended and {"settings": list(ended.settings), "steps": ended.steps, "psnr_db": ended.tried.psnr_db,
                            "cpu_seconds": ended.tried.cost_s},
        "trials": [
            {"settings": list(t.settings), "steps": t.steps, "psnr_db": t.tried.psnr_db, "cpu_seconds": t.tried.cost_s}
            for t in found.search.trials
        ],
    }  # fmt: skip
