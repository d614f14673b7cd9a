"""Both meshes of a scene, in its colours, each from the photographs of its own roles; side by side where there is room."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from jaxtyping import Int

from aug3d_core.depth.files import BASELINE_FUSED, FUSED
from aug3d_core.geometry.stored_points import StoredPoints
from aug3d_core.geometry.views import Tracks, Views
from aug3d_core.run.stage import Progress
from aug3d_core.sfm.files import TRACKS, VIEW_IMAGES, VIEW_MASKS, VIEWS
from aug3d_core.split.files import read_roles
from aug3d_core.surface.build import Built, build
from aug3d_core.surface.clock import Clock
from aug3d_core.surface.config import SurfaceConfig
from aug3d_core.surface.draw import affordable, draw, own_processes
from aug3d_core.surface.files import (
    BASELINE_MESH,
    BASELINE_MESH_TEXTURE,
    BASELINE_TEXTURED_MESH,
    MESH,
    MESH_TEXTURE,
    PIECES,
    TEXTURED_MESH,
)
from aug3d_core.surface.kept import Kept
from aug3d_core.surface.tiles import MOST_POINTS


@dataclass(frozen=True)
class Wanted:
    """A mesh that a scene has: the roles of its photographs, its fused points, and what its files are called."""

    name: str
    roles: tuple[str, ...]
    fused: str
    mesh: str
    textured: str
    texture: str

    def points(self, depth: Path) -> int:
        """Return how many points it is drawn through."""
        return len(StoredPoints.open(depth / self.fused))


TRAIN = Wanted("train", ("train",), FUSED, MESH, TEXTURED_MESH, MESH_TEXTURE)
GIVEN = Wanted(
    "given",
    ("train", "gap", "support"),
    BASELINE_FUSED,
    BASELINE_MESH,
    BASELINE_TEXTURED_MESH,
    BASELINE_MESH_TEXTURE,
)


@dataclass(frozen=True)
class Scene:
    """What is the same for both meshes."""

    views: Views
    tracks: Tracks
    role: np.ndarray
    images: Path
    masks: Path
    config: SurfaceConfig

    @classmethod
    def load(cls, inputs: Mapping[str, Path], config: SurfaceConfig) -> Scene:
        """Read what earlier stages left."""
        views = Views.load(inputs["sfm"] / VIEWS)
        return cls(
            views,
            Tracks.load(inputs["sfm"] / TRACKS),
            read_roles(inputs["grouping"], len(views)),
            inputs["sfm"] / VIEW_IMAGES,
            inputs["sfm"] / VIEW_MASKS,
            config,
        )

    def having(self, *roles: str) -> Int[np.ndarray, " m"]:
        """Return the views of these roles."""
        return np.flatnonzero(np.isin(self.role, roles))


def both(scene: Scene, depth: Path, out: Path, clock: Clock, progress: Progress) -> tuple[Built, Built]:
    """Return the mesh of the train photographs and that of all given ones, saved; raises InputError where one has no surface.

    Little of the work can use a second core, so the first is made in a process of its own, if memory allows. Its photographs
    are among those of the second, which takes longer and so tells of the progress.
    """
    each = affordable(max(min(wanted.points(depth), MOST_POINTS) for wanted in (TRAIN, GIVEN))) // 2
    train, given = len(scene.having(*TRAIN.roles)), len(scene.having(*GIVEN.roles))
    tick = _counter(2 * (given if each else train + given) + 1, progress)

    def told(done: int, tiles: int) -> None:
        progress(done, tiles, "drawing the surface, tile by tile")

    if not each:
        first, second = (_made(scene, wanted, depth, out, each, clock, told, tick) for wanted in (TRAIN, GIVEN))
        return first, second
    with own_processes(1, "make the mesh of the train photographs") as pool:
        beside = pool.submit(_made_beside, scene, depth, out, each)
        second = _made(scene, GIVEN, depth, out, each, clock, told, tick)
        first, spent = beside.result()
    clock.add(spent)
    return first, second


def _made_beside(scene: Scene, depth: Path, out: Path, at_once: int) -> tuple[Built, Clock]:
    clock = Clock()
    return _made(scene, TRAIN, depth, out, at_once, clock, lambda done, tiles: None, lambda: None), clock


def _made(
    scene: Scene,
    wanted: Wanted,
    depth: Path,
    out: Path,
    at_once: int,
    clock: Clock,
    told: Callable[[int, int], None],
    tick: Callable[[], None],
) -> Built:
    """Draw and colour a mesh, and save it. at_once: tiles that are drawn at a time; 0: as many as there is room for."""
    chosen, kept = scene.having(*wanted.roles), Kept(out / PIECES / wanted.name)
    drawn = draw(
        depth / wanted.fused, scene.views, chosen, scene.config, clock, told, at_once=at_once or None, kept=kept
    )
    built = build(drawn, scene.tracks, scene.views, chosen, scene.images, scene.masks, scene.config, clock, tick, kept)
    built.mesh.save(out / wanted.mesh)
    if built.textured is not None:
        built.textured.save(out / wanted.textured, out / wanted.texture)
    return built


def _counter(total: int, progress: Progress) -> Callable[[], None]:
    done = 0

    def tick() -> None:
        nonlocal done
        done += 1
        progress(min(done, total), total, "colouring the mesh")

    progress(0, total, "drawing the surface")
    return tick
