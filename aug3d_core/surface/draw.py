"""The surface through the fused points, without colours: as a whole or, of a large scene, tile by tile and then joined.

A tile is drawn with a margin of its neighbours' points, so that both sides of a border agree about it, and decimated with
that margin too, so that nothing pulls at the border. Only then it is cut to its ground, and joined to its neighbours.
"""

from __future__ import annotations

import json
import os
import signal
from collections.abc import Callable, Iterator
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from dataclasses import dataclass, fields
from functools import partial
from multiprocessing import get_context
from pathlib import Path
from statistics import median, median_high

import numpy as np
import psutil
from jaxtyping import Float, Int, UInt8

from aug3d_core.geometry.fused import Fused
from aug3d_core.geometry.ground_tiles import EVERYWHERE, Halved, Planned, Tile, leaves
from aug3d_core.geometry.stored_points import IndexedPoints, StoredPoints
from aug3d_core.geometry.views import Views, _Arrays
from aug3d_core.run.errors import InputError
from aug3d_core.run.helper_process import WorkerDied
from aug3d_core.run.linux_process import die_with_parent
from aug3d_core.run.memory import total_bytes
from aug3d_core.surface.clip import clip_to
from aug3d_core.surface.clock import Clock
from aug3d_core.surface.colour import ground_sampling
from aug3d_core.surface.config import SurfaceConfig
from aug3d_core.surface.decimate import decimate
from aug3d_core.surface.evidence import gather
from aug3d_core.surface.hidden import with_hidden
from aug3d_core.surface.join import join
from aug3d_core.surface.kept import NOTHING_KEPT, Kept
from aug3d_core.surface.poisson import octree_depth, reconstruct
from aug3d_core.surface.shape import Shape, triangle_areas
from aug3d_core.surface.tiles import MOST_POINTS, plan_tiles
from aug3d_core.surface.trim import bridged, trim

# Spacings around a tile, at least: Poisson's finest cell is two, and points a few coarser cells away no longer bend it
MARGIN_SPACINGS = 48.0
# Two tiles' surfaces that are nearer at their border are one. Twice as far as a point speaks for a surface: of 16 tiles of the
# demo's town, 1.3 % of the borders' length then stays open by more than 0.05 spacings, and 1.2 % at half of this
JOIN_SPACINGS = 4.0
# Memory of a tile's process for each of its points: 0.7 KiB for those read, a fifth more than its own (measured), and the rest
POINT_BYTES = 1100
MEMORY_SHARE = 0.5  # of what is free, for all tiles that are drawn at a time
_NO_SHAPE = Shape(np.zeros((0, 3)), np.zeros((0, 3), np.int32))


@dataclass(frozen=True)
class Drawn:
    """A surface and how it came about. Lengths in world units; of several tiles, medians unless they say otherwise."""

    shape: Shape
    points: int  # that it was drawn through
    spacing: float  # of the points
    octree_depth: int
    triangles_full: int  # before decimation
    decimation_error: float  # of the worst tile
    ground_sampling: float  # of the photos on the surface, world units per px
    area: float
    bridged_area: float  # closed gaps, where no point is
    tiles: int


def draw(
    fused: Path,
    views: Views,
    chosen: Int[np.ndarray, " m"],
    config: SurfaceConfig,
    clock: Clock,
    told: Callable[[int, int], None] = lambda done, tiles: None,
    most: int = MOST_POINTS,
    at_once: int | None = None,
    kept: Kept = NOTHING_KEPT,
) -> Drawn:
    """Draw the surface that stored points support, in tiles if there are more than `most`; raises InputError if none.

    told: called with the number of tiles that are drawn, and of all. at_once: processes; as many as cores and memory allow
    where it is None. The surface is the same with any number. kept: tiles that are drawn already.
    """
    stored = StoredPoints.open(fused)
    work = _Work(views, chosen, config, kept)
    if len(stored) <= most:
        one = work.tile(0, partial(Fused.load, fused), EVERYWHERE, EVERYWHERE)
        clock.add(one.clock)
        if one.drawn is None:
            raise nothing(one.problem)
        return one.drawn
    with clock.step("tiling"):
        plan, indexed = plan_tiles(stored, most), IndexedPoints.of(stored)
    tiles = [*leaves(plan)]
    # Of a gap's width: so far points away decide whether a gap that ends at a border is closed
    margin = max(MARGIN_SPACINGS, config.max_gap_spacings)
    tried = []
    told(0, len(tiles))
    for one in _each(
        partial(_tile, work, indexed, margin), [*enumerate(tiles)], min(len(tiles), at_once or affordable(most))
    ):
        tried.append(one)
        told(len(tried), len(tiles))
    clock.add(*(one.clock for one in tried))
    drawn = [one.drawn for one in tried if one.drawn is not None]
    if not drawn:
        raise nothing(tried[0].problem)
    with clock.step("tiling"):
        shape = _joined(plan, iter(tried), JOIN_SPACINGS * max(one.spacing for one in drawn))
    return Drawn(
        shape,
        sum(one.points for one in drawn),
        median(one.spacing for one in drawn),
        median_high(one.octree_depth for one in drawn),
        sum(one.triangles_full for one in drawn),
        max(one.decimation_error for one in drawn),
        median(one.ground_sampling for one in drawn),
        sum(one.area for one in drawn),
        sum(one.bridged_area for one in drawn),
        len(tiles),
    )


@dataclass(frozen=True)
class _Tried:
    """A tile's surface, or why there is none: over water, say, while other tiles have one."""

    drawn: Drawn | None
    problem: str
    clock: Clock


@dataclass(frozen=True)
class _Stored(_Arrays):
    """The same as arrays. told: all but the shape, as JSON."""

    xyz: Float[np.ndarray, "v 3"]
    triangles: Int[np.ndarray, "t 3"]
    told: UInt8[np.ndarray, " b"]

    @classmethod
    def of(cls, tried: _Tried) -> _Stored:
        figures = {} if tried.drawn is None else {one.name: getattr(tried.drawn, one.name) for one in fields(Drawn)}
        shape = figures.pop("shape", _NO_SHAPE)
        told = json.dumps({"figures": figures, "problem": tried.problem, "seconds": tried.clock.seconds})
        return cls(shape.xyz, shape.triangles, np.frombuffer(told.encode(), np.uint8))

    def tried(self) -> _Tried:
        told = json.loads(self.told.tobytes())
        shape, figures = Shape(self.xyz, self.triangles), told["figures"]
        return _Tried(Drawn(shape, **figures) if figures else None, told["problem"], Clock(told["seconds"]))


@dataclass(frozen=True)
class _Work:
    """What is the same for every tile."""

    views: Views
    chosen: Int[np.ndarray, " m"]
    config: SurfaceConfig
    kept: Kept

    def tile(self, number: int, points: Callable[[], Fused], ground: Tile, read: Tile) -> _Tried:
        """Draw a tile through the points over `read`, unless it is drawn already."""

        def make() -> _Stored:
            clock = Clock()
            with clock.step("tiling"):
                fused = points()
            try:
                drawn = _draw(fused, ground, read, self.views, self.chosen, self.config, clock)
                return _Stored.of(_Tried(drawn, "", clock))
            except InputError as error:
                return _Stored.of(_Tried(None, error.problem, clock))

        return self.kept.piece(f"tile_{number:05}", _Stored, make).tried()


def affordable(most: int) -> int:
    """Return how many tiles the cores and the free memory can draw at a time."""
    free = min(psutil.virtual_memory().available, total_bytes())
    return max(1, min(len(os.sched_getaffinity(0)), int(MEMORY_SHARE * free / (POINT_BYTES * most))))


@contextmanager
def own_processes(at_once: int, work: str) -> Iterator[ProcessPoolExecutor]:
    """Give processes that end when this one is killed: a stage that is tried again finds nobody else at its work.

    work: what they do, "draw a tile". Raises WorkerDied if one of them is killed.
    """
    as_child = (signal.SIGKILL, os.getpid())
    with ProcessPoolExecutor(at_once, get_context("spawn"), initializer=die_with_parent, initargs=as_child) as pool:
        try:
            yield pool
        except BrokenProcessPool as error:
            problem = f"a process that was to {work} was killed"
            raise WorkerDied(problem, "It was killed, mostly for memory: lower depth.max_px.", "killed") from error


def _each(
    work: Callable[[tuple[int, Planned]], _Tried], tiles: list[tuple[int, Planned]], at_once: int
) -> Iterator[_Tried]:
    """Yield what is made of each tile, in their order, in processes of their own: their memory is given back."""
    with own_processes(at_once, "draw a tile of the surface") as pool:
        yield from pool.map(work, tiles)


def _tile(work: _Work, fused: IndexedPoints, margin: float, numbered: tuple[int, Planned]) -> _Tried:
    """Draw a tile through its points and those within a margin (spacings)."""
    number, tile = numbered
    around = tile.ground.grown(margin * tile.spacing)
    return work.tile(number, partial(fused.over, around), tile.ground, around)


def _draw(
    fused: Fused,
    ground: Tile,
    read: Tile,
    views: Views,
    chosen: Int[np.ndarray, " m"],
    config: SurfaceConfig,
    clock: Clock,
) -> Drawn:
    """Draw the surface over `ground`, through the points of `read`; raises InputError if there is none."""
    with clock.step("evidence"):
        evidence = gather(fused)
        max_gap = config.max_gap_spacings * evidence.spacing
        completed = with_hidden(evidence, views, chosen, max_gap)
    with clock.step("poisson"):
        raw = reconstruct(completed)
    with clock.step("trimming"):
        fine = trim(raw, completed, max_gap, config.min_piece_points, read)
    if not len(fine.triangles):
        raise nothing(f"no surface stands through the {len(evidence.xyz)} fused points")
    sampling = ground_sampling(fine, views, chosen)
    if np.isnan(sampling):
        raise nothing("no photograph frames any of the surface through the fused points")
    with clock.step("decimation"):
        coarse = decimate(fine, config.max_error_gsd * sampling)
    own = ground.holds(fine.xyz[fine.triangles].mean(axis=1))
    area = triangle_areas(fine)[own]
    return Drawn(
        clip_to(coarse.shape, ground),
        int(ground.holds(evidence.xyz).sum()),
        evidence.spacing,
        octree_depth(evidence),
        int(own.sum()),
        coarse.error,
        sampling,
        float(area.sum()),
        float(area[bridged(fine, evidence)[own]].sum()),
        1,
    )


def nothing(problem: str) -> InputError:
    """Return the error of a scene that has no surface."""
    return InputError(
        problem, "take more photos of textured ground with at least 60 % overlap, or use larger working copies"
    )


def _joined(plan: Halved | Planned, tried: Iterator[_Tried], reach: float) -> Shape:
    """Join the tiles in their order, neighbours first."""
    if isinstance(plan, Planned):
        drawn = next(tried).drawn
        return _NO_SHAPE if drawn is None else drawn.shape
    below = _joined(plan.below, tried, reach)
    return join(below, _joined(plan.above, tried, reach), plan, reach)
