"""What the benchmark of grouping makes of the overlaps on each path: the worst one counts, ties are neither won nor lost."""

from __future__ import annotations

import pytest

from aug3d_core.bench.grouping import PATHS, path_figures
from aug3d_core.factory.config import scene_config
from aug3d_core.groups.methods import METHODS
from aug3d_core.overlap.comparison import BEST
from aug3d_core.run.stage import Metric
from aug3d_core.store.record import Record
from aug3d_core.studies.common.trial import Trial


def trial(**bad: float | None) -> Trial:
    """Return a trial whose overlap stage told these shares of bad members, and 0.5 for every other way."""
    metrics: dict[str, Metric] = {f"bad_members_{way}_k10": bad.get(way, 0.5) for way in (*METHODS, BEST)}
    return Trial({"overlap": Record(
        stage="overlap", key="", digest="", recipe="", config={}, inputs={}, versions={}, files={}, metrics=metrics,
        state="ok", notes=(), series={}, pictures={}, seconds=1.0, peak_mib=1.0,
    )})  # fmt: skip


def test_the_worst_path_counts_and_each_is_told() -> None:
    figures = path_figures({"nadir": trial(shared=0.01, ray=0.2), "free": trial(shared=0.04, ray=0.1)})
    assert figures["bad_members_shared_k10"].value == 0.04 and figures["bad_members_shared_k10"].holds
    assert figures["bad_members_ray_k10"].value == 0.2
    assert figures["bad_members_shared_k10_nadir"].value == 0.01
    assert not path_figures({"nadir": trial(shared=0.06)})["bad_members_shared_k10"].holds


def test_a_tie_is_no_win_and_no_loss() -> None:
    figures = path_figures(
        {"nadir": trial(shared=0.0, ray=0.0, grid=0.1), "free": trial(shared=0.1, ray=0.0, grid=0.2)}
    )
    assert figures["paths_shared_fewer_bad_than_ray_k10"].value == 0
    assert figures["paths_shared_more_bad_than_ray_k10"].value == 1
    assert figures["paths_shared_fewer_bad_than_ray_k10"].holds is False
    assert (
        figures["paths_shared_fewer_bad_than_grid_k10"].holds and figures["paths_shared_more_bad_than_grid_k10"].holds
    )


def test_a_path_that_failed_is_told_and_leaves_no_worst_figure() -> None:
    figures = path_figures({"nadir": trial(shared=0.01), "free": Trial({}, "town: no Blender")})
    assert figures["bad_members_shared_k10"].value is None and figures["bad_members_shared_k10"].holds is False
    assert figures["bad_members_ray_k10"].failure == "free: town: no Blender"
    assert figures["bad_members_shared_k10_nadir"].value == 0.01


@pytest.mark.parametrize("path", PATHS)
def test_every_path_can_be_flown(path: str) -> None:
    assert scene_config("tiny", [f"town.path={path}"]).town.path == path
