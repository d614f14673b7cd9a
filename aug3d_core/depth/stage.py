"""The depth stage: a depth and a normal map of each photograph but the targets, and two sets of fused points.

Targets are never read, and spare photographs are not needed. A train photograph is compared with train photographs only, so
that `fused.npz`, which the rendered domes grow from, holds nothing of any other; `baseline_fused.npz` may use all others.
"""

from __future__ import annotations

import shutil
import time
from collections.abc import Callable
from pathlib import Path
from typing import Literal, NamedTuple

import numpy as np

from aug3d_core.depth.cameras import depth_sizes
from aug3d_core.depth.config import DepthConfig
from aug3d_core.depth.decisions import decisions
from aug3d_core.depth.files import (
    BASELINE_FUSED,
    DENSE_WORKSPACE,
    DEPTH_MAPS,
    DEPTH_SHEET,
    FUSED,
    FUSED_TILES,
    MADE_OF,
    NORMAL_MAPS,
    RAW,
    geometric_map_name,
    planes_name,
)
from aug3d_core.depth.fusion_tiles import Dense, fuse_to
from aug3d_core.depth.job import DepthJob, PhotoTask
from aug3d_core.depth.launch import run_jobs
from aug3d_core.depth.patch_match import check_patch_match, patch_match
from aug3d_core.depth.picture import draw_sheet
from aug3d_core.depth.ranges import depth_and_height_ranges
from aug3d_core.depth.reuse import copy_known, made_of, write_made_of
from aug3d_core.depth.sources import choose_sources
from aug3d_core.depth.workspace import IMAGES, mask_maps, write_patch_match_list, write_workspace
from aug3d_core.geometry.depth_maps import read_map
from aug3d_core.geometry.masks import used_pixels
from aug3d_core.geometry.rows import Rows
from aug3d_core.geometry.spread import evenly_spread
from aug3d_core.geometry.views import Points, Tracks, Views
from aug3d_core.photos.files import image_name
from aug3d_core.run.errors import InputError
from aug3d_core.run.files import EARLIER
from aug3d_core.run.stage import Inputs, Metric, Outcome, Progress, from_elsewhere
from aug3d_core.sfm.files import POINTS, TRACKS, VIEW_IMAGES, VIEW_MASKS, VIEWS
from aug3d_core.split.files import read_roles

OTHERS_PER_SOURCE = 2  # depth maps compared, for each photograph compared: far cheaper, and they confirm the rims
WORKERS = 2  # processes of one thread each; the result is the same for any number
LOW_SHARE = 0.3
PICTURE_ROWS = 4


class _Searched(NamedTuple):
    """How depth was searched."""

    planes: list[int]  # tried for each photograph that was swept; empty if the engine has none
    made: int  # photographs whose depth was searched in this try
    reused: int  # photographs whose map an earlier run made


def run(inputs: Inputs, config: DepthConfig, out: Path, progress: Progress) -> Outcome:
    """Find depth, keep what other photographs confirm, and fuse it; raises InputError if no photographs overlap."""
    sfm, workspace = inputs["sfm"], out / DENSE_WORKSPACE
    views, images, masks = Views.load(sfm / VIEWS), sfm / VIEW_IMAGES, sfm / VIEW_MASKS
    points, tracks = Points.load(sfm / POINTS), Tracks.load(sfm / TRACKS)
    role = read_roles(inputs["grouping"], len(views))
    train, sources = role == "train", _sources(views, points, tracks, role, config)
    if config.engine == "patch_match":
        check_patch_match()
    usable = [view for view, chosen in sources.items() if chosen]
    if not usable:
        raise InputError(
            "no photograph shares enough points with another for depth", "take photographs that overlap by 60 % or more"
        )
    sizes = depth_sizes(views, config.max_px)
    write_workspace(workspace, views, sizes, points, tracks, images, masks, usable)
    write_patch_match_list(workspace, views, {view: chosen[: config.sources] for view, chosen in sources.items()})
    started = time.monotonic()
    if config.engine == "patch_match":
        patch_match(workspace)
        mask_maps(workspace, views, masks, usable)
        search = _Searched(planes=[], made=len(usable), reused=0)
    else:
        tasks = _tasks(views, points, tracks, sources, config)
        digests = made_of(tasks, views, sizes, images, masks)
        search = _search(tasks, digests, views, inputs, config, out, progress)
    seconds = time.monotonic() - started
    dense = Dense(workspace, views, sizes, points, tracks)

    def told(done: int, tiles: int) -> None:
        progress(done, tiles, "fusing depth maps, tile by tile")

    fused, tiles = fuse_to(out / FUSED, dense, [view for view in usable if train[view]], told)
    baseline, baseline_tiles = fuse_to(out / BASELINE_FUSED, dense, usable, told)
    draw_sheet(out, images, views, evenly_spread(np.array(usable), PICTURE_ROWS).tolist())
    share = _consistent_share(out, views, masks, usable)
    _drop_scratch(out)
    metrics: dict[str, Metric] = {
        "photos": len(usable),
        "photos_reused": search.reused,
        "engine": config.engine,
        "seconds_per_photo": round(seconds / search.made, 3) if search.made else None,  # None: all were there
        "depth_width_px": int(np.median(sizes[usable, 0])),
        "consistent_share": round(share, 4),
        "points": fused,
        "baseline_points": baseline,
        "tiles": tiles,
        "baseline_tiles": baseline_tiles,
    }
    if search.planes:
        metrics |= {
            "planes_median": int(np.median(search.planes)),
            "planes_reason": f"adjacent planes move a source pixel by {config.plane_step_px:g} px at most",
        }
    notes = _notes(views, sources, share, fused)
    return Outcome(
        metrics=metrics,
        state="degraded" if notes else "ok",
        notes=notes,
        pictures={"Photos, their depth (near is yellow) and normals; grey: no depth": DEPTH_SHEET},
        decisions=tuple(decisions(metrics)),
    )


def assist(inputs: Inputs, config: DepthConfig, out: Path, progress: Progress) -> Outcome:
    """Sweep photographs that nobody has swept yet, and whose maps are not there."""
    sfm = inputs["sfm"]
    views, points, tracks = Views.load(sfm / VIEWS), Points.load(sfm / POINTS), Tracks.load(sfm / TRACKS)
    sources = _sources(views, points, tracks, read_roles(inputs["grouping"], len(views)), config)
    tasks = _tasks(views, points, tracks, sources, config)
    maps = {task.view: out / NORMAL_MAPS / geometric_map_name(int(views.photo_id[task.view])) for task in tasks}
    tasks = from_elsewhere(_left(tasks, {view for view, path in maps.items() if path.exists()})[0])
    if config.engine != "patch_match":
        (out / RAW).mkdir(exist_ok=True)
        run_jobs(_jobs("sweep", tasks, sfm, out / DENSE_WORKSPACE, config), _ticking(progress, len(tasks)))
    return Outcome(metrics={"photos": len(tasks)})


def _sources(
    views: Views, points: Points, tracks: Tracks, role: np.ndarray, config: DepthConfig
) -> dict[int, list[int]]:
    given = np.isin(role, ["train", "gap", "support"])
    return choose_sources(views, points, tracks, given, role == "train", OTHERS_PER_SOURCE * config.sources)


def _tasks(
    views: Views, points: Points, tracks: Tracks, sources: dict[int, list[int]], config: DepthConfig
) -> list[PhotoTask]:
    by_view = Rows(tracks.view, len(views))
    return [
        PhotoTask(view=view, sources=tuple(chosen[: config.sources]), others=tuple(chosen), depth=depth, height=height)
        for view, chosen in sources.items()
        if chosen
        for seen in [points.xyz[tracks.point[by_view.having(np.array([view]))]]]
        for depth, height in [depth_and_height_ranges(views.cam_from_world[view], seen)]
    ]


def _search(
    tasks: list[PhotoTask],
    digests: dict[int, str],
    views: Views,
    inputs: Inputs,
    config: DepthConfig,
    out: Path,
    progress: Progress,
) -> _Searched:
    """Copy the maps that an earlier run made of the same, sweep the other photographs, then compare their maps.

    digests: of what the map of each view is made of.
    """
    sfm, workspace = inputs["sfm"], out / DENSE_WORKSPACE
    known = copy_known(digests, views, inputs.get(EARLIER), out)
    to_sweep, to_compare = _left(tasks, known)
    (out / RAW).mkdir(exist_ok=True)
    swept, compared = ([int(views.photo_id[task.view]) for task in left] for left in (to_sweep, to_compare))
    made = len(swept) - _swept(out, swept, compared)
    tick = _ticking(progress, len(to_sweep), len(to_compare))
    planes = run_jobs(_jobs("sweep", to_sweep, sfm, workspace, config), tick)
    run_jobs(_jobs("compare", to_compare, sfm, workspace, config), tick)
    for raw in (out / RAW).glob("*.bin"):
        raw.unlink()  # all are compared; what is left says that none is to be swept again
    write_made_of(digests, views, out / MADE_OF)
    return _Searched([int(count) for share in planes for count in share], made, len(known))


def _left(tasks: list[PhotoTask], known: set[int]) -> tuple[list[PhotoTask], list[PhotoTask]]:
    """Return which tasks are to be swept, and which compared, where the maps of some views are known.

    What a known photograph shows is swept again if another needs it: its depth before it was compared is not kept.
    """
    to_compare = [task for task in tasks if task.view not in known]
    needed = {view for task in to_compare for view in (task.view, *task.others)}
    return [task for task in tasks if task.view in needed], to_compare


def _swept(out: Path, photo_ids: list[int], to_compare: list[int]) -> int:
    """Return how many photographs an earlier try has swept.

    Where maps are still to be compared and a raw one is gone, as after a machine that was lost in between, its photograph
    counts as never swept.
    """
    told = {photo: out / RAW / planes_name(photo) for photo in photo_ids}
    if not all((out / NORMAL_MAPS / geometric_map_name(photo)).exists() for photo in to_compare):
        for photo, file in told.items():
            if not (out / RAW / geometric_map_name(photo)).exists():
                file.unlink(missing_ok=True)
    return sum(file.exists() for file in told.values())


def _ticking(progress: Progress, swept: int, compared: int = 0) -> Callable[[], None]:
    done = 0

    def tick() -> None:
        nonlocal done
        done += 1
        progress(done, swept + compared, "searching depth" if done <= swept else "comparing depth maps")

    return tick


def _jobs(
    step: Literal["sweep", "compare"], tasks: list[PhotoTask], sfm: Path, workspace: Path, config: DepthConfig
) -> list[DepthJob]:
    """Return the jobs of one step, side by side."""
    common = DepthJob(
        step=step,
        views=sfm / VIEWS,
        images=sfm / VIEW_IMAGES,
        masks=sfm / VIEW_MASKS,
        raw=workspace.parent / RAW,
        workspace=workspace,
        max_px=config.max_px,
        plane_step_px=config.plane_step_px,
        tasks=(),
    )
    shares = [tuple(tasks[i::WORKERS]) for i in range(WORKERS)]
    return [common.model_copy(update={"tasks": share}) for share in shares if share]


def _drop_scratch(out: Path) -> None:
    """Drop what a try that is killed goes on from: only when all else is there."""
    shutil.rmtree(out / DENSE_WORKSPACE / IMAGES)
    for folder in (RAW, FUSED_TILES):
        shutil.rmtree(out / folder, ignore_errors=True)
    for photometric in (out / DENSE_WORKSPACE).glob("stereo/*_maps/*.photometric.bin"):
        photometric.unlink()  # patch-match's first pass


def _consistent_share(out: Path, views: Views, masks: Path, chosen: list[int]) -> float:
    """Return the share of the pixels that are used which has a depth."""
    shares = []
    for photo_id in views.photo_id[chosen]:
        depth = read_map(out / DEPTH_MAPS / geometric_map_name(photo_id))
        used = used_pixels(masks / image_name(photo_id), depth.shape[::-1])
        shares.append((depth > 0).mean() if used is None else (depth > 0).sum() / max(used.sum(), 1))
    return float(np.mean(shares))


def _notes(views: Views, sources: dict[int, list[int]], share: float, points: int) -> tuple[str, ...]:
    notes = []
    if lonely := [str(views.photo_id[view]) for view, chosen in sources.items() if not chosen]:
        listed = ", ".join(lonely[:10]) + (", ..." if len(lonely) > 10 else "")
        notes.append(f"{len(lonely)} photos share too few points with any other and have no depth: {listed}")
    if share < LOW_SHARE:
        notes.append(f"only {100 * share:.0f} % of the pixels have a depth that other photos confirm")
    if not points:
        notes.append("no point is agreed on by two train photos")
    return tuple(notes)
