"""Keep the earlier photographs of a grown scene exactly where they were, if the new ones fit that as well.

What is made of photographs that no new one touches then stays as it was, to the bit, and need not be made again. Adjusted all
together they move by less than they are uncertain: a tenth of new photographs, in towns of 120 and 261, moved them by 0.005 to
0.01 % of the extent, where poses are 0.02 % off; the new ones fit earlier poses that stay with 1.01 times the error.

So the new ones are first mapped about earlier ones that stay, which takes half the time of mapping that moves all. Whether
they fit is asked of a few, by letting those beside them move: that takes no longer in a larger scene.
"""

from __future__ import annotations

import copy
import json
from collections import Counter, defaultdict
from collections.abc import Mapping, Set
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pandas as pd
import pycolmap
from jaxtyping import Float, Int

from aug3d_core.geometry.rows import Rows
from aug3d_core.geometry.similarity import Similarity, fit_similarity
from aug3d_core.geometry.transforms import apply, centres, project
from aug3d_core.geometry.views import Views
from aug3d_core.sfm import export
from aug3d_core.sfm.align import Alignment
from aug3d_core.sfm.camera_model import adjustment_options, without_wrong_points
from aug3d_core.sfm.control import surveyed
from aug3d_core.sfm.control_adjustment import Adjusted
from aug3d_core.sfm.doming import Doming
from aug3d_core.sfm.files import WORLD
from aug3d_core.sfm.grow import Earlier
from aug3d_core.sfm.straighten import sure_bend
from aug3d_core.sfm.write import Located, believed, by_gps, gps_about

_MOST_NEW = 0.25  # of the photographs: more tell the poses of the others better than these did by themselves
_ASKED, _BESIDE = 12, 6  # new photographs that are asked whether they fit, and earlier ones beside each
_CONTROL = "control points move all poses"
_FITS, _AS_WELL = 1.05, 1.1  # times an error, that of new photographs and that of GPS, that earlier poses may cost


@dataclass(frozen=True)
class Held:
    """A model in the earlier one's world, how that was found, and what the model holds."""

    model: pycolmap.Reconstruction
    located: Located
    arrays: export.Arrays


def why_all_move(earlier: Earlier, photos: int, control: bool) -> str:
    """Return why the earlier poses cannot stay in a scene of so many photographs, "" if they may. control: it has points."""
    if control:
        return _CONTROL
    new = photos - earlier.settled
    return (
        f"{new} of {photos} photographs are new since all poses were found together" if new > _MOST_NEW * photos else ""
    )


def hold(
    grown: pycolmap.Reconstruction, earlier: Earlier, photos: pd.DataFrame, marks: pd.DataFrame | None, seed: int
) -> tuple[Held | None, str]:
    """Return the earlier model with the new photographs of the grown one and what these see, and what was found.

    Nothing of the earlier model moves. None where new photographs or GPS contradict the earlier poses, or where a world or
    a bend is told that was not told before. grown: mapped about the earlier poses. photos: the whole table.
    marks: of control points, which move all poses where they tell a world.
    """
    now, before = export.to_arrays(grown), earlier.arrays()
    new = np.setdiff1d(now.views.photo_id, before.views.photo_id)
    if len(now.views) - len(new) < len(before.views):
        return None, "some of the earlier photographs have no pose now"
    model = _added(earlier.model, grown)
    arrays = _as_they_were(export.to_arrays(model), before)
    asked = new[np.linspace(0, len(new) - 1, min(len(new), _ASKED)).astype(int)]
    freed = export.to_arrays(_freed(model, asked, new)) if len(new) else arrays
    times = _off_px(arrays, asked) / max(_off_px(freed, asked), 1e-9)
    found = (
        f"new photographs fit earlier poses with {times:.2f} times the error that they have where their neighbours move too"
        if len(new)
        else "no new photograph is placed"
    )
    if times > _FITS:
        return None, found
    told = surveyed(grown, marks)
    if told and told.world_from_model:
        return None, _CONTROL
    world = by_gps(now, photos, np.random.default_rng(seed))
    located = _where_it_was(json.loads((earlier.files / WORLD).read_text()), world, arrays, photos)
    if located is None:
        return None, f"{found}, but GPS tells another world than before"
    if bend := _new_bend(arrays.views, before.views, believed(located.alignment, photos)):
        return None, f"{found}, but {bend.told_by} now tell a bend of {bend.pct:+.2g} % of the flight's extent"
    return Held(model, replace(located, control=told and Adjusted(told, False)), arrays), found


def _added(earlier: pycolmap.Reconstruction, grown: pycolmap.Reconstruction) -> pycolmap.Reconstruction:
    """Return the earlier model with the grown one's new photographs and what these see, adjusted to the earlier poses."""
    model, kept = pycolmap.Reconstruction(earlier), set(earlier.reg_image_ids())
    moved = pycolmap.Reconstruction(grown)
    there = [image for image in export.registered(moved) if image.image_id in kept]
    fit = fit_similarity(
        np.array([image.projection_center() for image in there]),
        np.array([earlier.image(image.image_id).projection_center() for image in there]),
    )
    moved.transform(pycolmap.Sim3d(fit.scale, pycolmap.Rotation3d(fit.rotation), fit.translation))
    for image in export.registered(moved):
        if image.image_id in kept:
            continue
        if not model.exists_camera(image.camera_id):
            model.add_camera_with_trivial_rig(copy.deepcopy(moved.camera(image.camera_id)))
        keypoints = np.array([point.xy for point in image.points2D]).reshape(-1, 2)
        entry = pycolmap.Image(image.name, keypoints, camera_id=image.camera_id, image_id=image.image_id)
        model.add_image_with_trivial_frame(entry, image.cam_from_world())
    for point_id in sorted(moved.point3D_ids()):
        point = moved.point3D(point_id)
        if any(element.image_id not in kept for element in point.track.elements):
            _add_point(model, point)
    adjust_some(model, set(model.reg_image_ids()) - kept)
    return without_wrong_points(model)


def _freed(
    held: pycolmap.Reconstruction, asked: Int[np.ndarray, " m"], new: Int[np.ndarray, " n"]
) -> pycolmap.Reconstruction:
    """Return a copy where some of the new photographs, and the earlier ones that see most of what they see, are adjusted."""
    model = pycolmap.Reconstruction(held)
    of_photo = {export.photo_id(image): image for image in export.registered(model)}
    earlier = {image.image_id for photo_id, image in of_photo.items() if photo_id not in new}
    free = set[int]()
    for image in (of_photo[photo_id] for photo_id in asked.tolist()):
        tracks = [model.point3D(point.point3D_id).track for point in image.get_observation_points2D()]
        beside = Counter(element.image_id for track in tracks for element in track.elements)
        nearest = [image_id for image_id, _ in beside.most_common() if image_id in earlier]
        free |= {image.image_id, *nearest[:_BESIDE]}
    adjust_some(model, free)
    return model


def adjust_some(model: pycolmap.Reconstruction, free: Set[int]) -> None:
    """Adjust some images and what they see, in place; all others stay, and hold it by what they see of it."""
    config = pycolmap.BundleAdjustmentConfig()
    for image_id in sorted(free):
        config.add_image(image_id)
        for point in model.image(image_id).get_observation_points2D():
            config.add_variable_point(point.point3D_id)
    options = adjustment_options(refine_focal_length=False, refine_distortion=False)
    pycolmap.create_default_bundle_adjuster(options, config, model).solve()


def _add_point(model: pycolmap.Reconstruction, point: pycolmap.Point3D) -> None:
    """Add a point in place of those that had some of its observations."""
    track = pycolmap.Track()
    for element in point.track.elements:
        observed = model.image(element.image_id).points2D[element.point2D_idx]
        if observed.has_point3D():
            model.delete_point3D(observed.point3D_id)
        track.add_element(element.image_id, element.point2D_idx)
    model.add_point3D(point.xyz, track, point.color)


def _as_they_were(arrays: export.Arrays, before: export.Arrays) -> export.Arrays:
    """Return what a model holds, with the poses and the points that it shares with an earlier one as these were, to the bit."""
    view_of = {photo_id: view for view, photo_id in enumerate(arrays.views.photo_id.tolist())}
    cam_from_world, xyz = arrays.views.cam_from_world.copy(), arrays.points.xyz.copy()
    cam_from_world[[view_of[photo_id] for photo_id in before.views.photo_id.tolist()]] = before.views.cam_from_world
    known = _by_sight(before)
    for sight, same in _by_sight(arrays).items():
        stayed = known.get(sight, [])[: len(same)]
        xyz[same[: len(stayed)]] = before.points.xyz[stayed]
    views, points = replace(arrays.views, cam_from_world=cam_from_world), replace(arrays.points, xyz=xyz)
    return export.Arrays(views, points, arrays.tracks)


def _by_sight(arrays: export.Arrays) -> dict[bytes, list[int]]:
    """Return the points by all photographs that see them, and where: two keypoints at one place may be of two points."""
    tracks, photo_id, points = arrays.tracks, arrays.views.photo_id[arrays.tracks.view], len(arrays.points.xyz)
    order = np.lexsort((photo_id, tracks.point))
    sights = np.column_stack([photo_id, tracks.xy])[order]
    first = np.searchsorted(tracks.point[order], np.arange(points + 1))
    found = defaultdict[bytes, list[int]](list)
    for point in range(points):
        found[sights[first[point] : first[point + 1]].tobytes()].append(point)
    return found


def _off_px(arrays: export.Arrays, photo_id: Int[np.ndarray, " m"]) -> float:
    """Return the median distance of what some photographs see to where it is projected; 0 if they see nothing."""
    views, xyz, tracks = arrays.views, arrays.points.xyz, arrays.tracks
    rows, off_px = Rows(tracks.view, len(views)), [np.zeros(0)]
    for view in np.flatnonzero(np.isin(views.photo_id, photo_id)):
        seen = rows.having(np.array([view]))
        there = project(apply(views.cam_from_world[view], xyz[tracks.point[seen]]), views.intrinsics[view])
        off_px.append(np.linalg.norm(there - tracks.xy[seen], axis=1))
    found_px = np.concatenate(off_px)
    return float(np.median(found_px)) if len(found_px) else 0.0


def _new_bend(now: Views, before: Views, gps_enu_m: Float[np.ndarray, "n 3"]) -> Doming | None:
    """Return the bend that is surely told now, and was not by the earlier photographs alone: what they told is taken out, or
    photographs contradict it. gps_enu_m: by photo id."""
    bend = sure_bend(now.cam_from_world, gps_enu_m[now.photo_id])
    return bend and (None if sure_bend(before.cam_from_world, gps_enu_m[before.photo_id]) else bend)


def _where_it_was(
    world: Mapping[str, Any], found: Alignment, arrays: export.Arrays, photos: pd.DataFrame
) -> Located | None:
    """Return the earlier world as that of the arrays; None if it was found otherwise than now, or GPS fits it worse."""
    if (world["metric"], world["up_from"]) != (found.metric, found.up_from):
        return None
    same = replace(found, world_from_model=Similarity(1.0, np.eye(3), np.zeros(3)))
    if not found.metric:
        return Located(same, np.full(3, np.nan))
    origin, alt_m = world["origin"], world["origin"]["alt_m"]
    about = np.array([origin["lat_deg"], origin["lon_deg"], alt_m or 0.0])
    gps_enu_m = gps_about(about, photos)[arrays.views.photo_id]
    residual_m = np.linalg.norm((centres(arrays.views.cam_from_world) - gps_enu_m)[:, :2], axis=1)
    if np.nanmedian(residual_m) > _AS_WELL * np.nanmedian(found.residual_m):
        return None
    return Located(replace(same, residual_m=residual_m, up_offset_m=np.nan if alt_m is None else 0.0), about)
