"""Ground control points: where a reconstruction has them, the world that they tell, and how far it is off at each.

A point is where the rays of its marks meet. The world is the similarity that fits the points, in east, north and up about their
middle; each point's own error is that of the world without it, as surveyors judge: check points never have a part in it.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import combinations
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd
from jaxtyping import Bool, Float, Int

from aug3d_core.geometry.geodesy import enu_from_geodetic, middle_of
from aug3d_core.geometry.similarity import Similarity, fit_similarity
from aug3d_core.geometry.transforms import centres

if TYPE_CHECKING:
    import pycolmap

FEWEST = 3
_FEWEST_TO_DOUBT = 5  # points of which one may be found wrong
_WRONG_SHARE = 0.005  # of a photograph's longer side: a mark farther from its point is a mistake
_TRIED = 20  # of a point's marks, whose pairs say where it may be
_LEAST_ANGLE_DEG = 2.0  # between the rays of two marks
_WRONG_FACTOR = 4.0  # so much better the others must fit without a point that is wrong,
WRONG_PX = 5.0  # and so many of its pixels it must be from where they have it
_LEAST_ACROSS = 0.05  # the spread of points across their line, over that along it: what holds a rotation about it
_MOST_DISAGREEMENT = 0.05  # RMS residual over the spread of the points


@dataclass(frozen=True)
class Marked:
    """A point as photographs show it. rays: x / z and y / z in the camera. focal_px: of each camera.

    without_ray: lines of its marks that lie where the lens has no ray: beyond where its picture folds over.
    """

    name: str
    check: bool
    geodetic: Float[np.ndarray, " 3"]
    photo_id: Int[np.ndarray, " m"]
    cam_from_model: Float[np.ndarray, "m 3 4"]
    rays: Float[np.ndarray, "m 2"]
    focal_px: Float[np.ndarray, " m"]
    wrong_px: Float[np.ndarray, " m"]
    line: Int[np.ndarray, " m"]
    without_ray: tuple[int, ...] = ()


@dataclass(frozen=True)
class Survey:
    """Control points in the world that they tell.

    world_from_model: None where they tell none; `problem` then says why. origin: latitude, longitude and height of their
    middle, the world's origin before its ground is known. table: a row for each point that was found: `point`, `role` (control,
    check, wrong), `marks`, `marks_px`; `x_m` and `y_m`, where it was surveyed, in the world; `pixel_m`, how large a pixel is
    there; `residual_*_m`: east, north and up off that; `error_*_m`: the same in the world without it, NaN where the others are
    too few. notes: marks and points that are not used. wrong_lines: of these marks.
    """

    world_from_model: Similarity | None
    origin: Float[np.ndarray, " 3"]
    table: pd.DataFrame
    notes: tuple[str, ...]
    wrong_lines: tuple[int, ...] = ()
    problem: str = ""

    @property
    def remarks(self) -> tuple[str, ...]:
        """Say which marks and points are wrong."""
        wrong = self.table.loc[self.table["role"] == "wrong"]
        off_m = np.linalg.norm(wrong[[f"residual_{axis}_m" for axis in AXES]], axis=1) if len(wrong) else ()
        return self.notes + tuple(
            f"control point {name} is {metres:.2f} m from where the others have it: not used"
            for name, metres in zip(wrong["point"], off_m, strict=True)
        )

    def rms_m(self, role: str) -> tuple[float, float] | None:
        """Return the RMS error of the points of a role, horizontal and up; None where none has one."""
        of_role = self.table.loc[self.table["role"] == role, [f"error_{axis}_m" for axis in AXES]].dropna().to_numpy()
        if not len(of_role):
            return None
        east, north, up = np.square(of_role).mean(axis=0)
        return float(np.sqrt(east + north)), float(np.sqrt(up))


AXES = ("east", "north", "up")


def marked_points(model: pycolmap.Reconstruction, control: pd.DataFrame) -> list[Marked]:
    """Return the points that placed photographs show, of the table of marks (`aug3d_core.photos.control`)."""
    images = {int(model.image(one).name.partition(".")[0]): model.image(one) for one in model.reg_image_ids()}
    placed = control.loc[control["photo_id"].isin(list(images))]
    points = []
    for name in placed["point"].unique():
        marks = placed.loc[placed["point"] == name]
        shown = [images[photo] for photo in marks["photo_id"]]
        cameras = [model.camera(image.camera_id) for image in shown]
        xy, line = marks[["x_px", "y_px"]].to_numpy(float), marks["line"].to_numpy()
        rays = np.concatenate([camera.cam_from_img(at[None]) for camera, at in zip(cameras, xy, strict=True)])
        seen = np.isfinite(rays).all(axis=1)
        points.append(
            Marked(
                name=name,
                check=bool(marks["check"].iloc[0]),
                geodetic=marks[["lat_deg", "lon_deg", "alt_m"]].iloc[0].to_numpy(float),
                photo_id=marks["photo_id"].to_numpy()[seen],
                cam_from_model=np.stack([image.cam_from_world().matrix() for image in shown])[seen],
                rays=rays[seen],
                focal_px=np.array([camera.mean_focal_length() for camera in cameras])[seen],
                wrong_px=np.array([_WRONG_SHARE * max(camera.width, camera.height) for camera in cameras])[seen],
                line=line[seen],
                without_ray=tuple(line[~seen].tolist()),
            )
        )
    return points


def surveyed(model: pycolmap.Reconstruction, marks: pd.DataFrame | None) -> Survey | None:
    """Return what marks of control points tell of a model; None without any."""
    return None if marks is None else survey(marked_points(model, marks))


def survey(points: list[Marked]) -> Survey:
    """Find the points, and the world that they tell."""
    found, notes, wrong_lines = [], [], []
    for point in points:
        wrong_lines += point.without_ray
        notes += [
            f"line {line} of the control points marks {point.name} where the lens has no ray: not used"
            for line in point.without_ray
        ]
        place, off_px, problem = located(point)
        if problem:
            notes.append(f"control point {point.name} is not used: {problem}")
        else:
            found.append((point, place, off_px))
            wrong = off_px > point.wrong_px
            wrong_lines += point.line[wrong].tolist()
            notes += [
                f"line {point.line[i]} of the control points marks {point.name} {off_px[i]:.0f} px beside where the other "
                "photographs show it: not used"
                for i in np.flatnonzero(wrong)
            ]
    origin = middle_of(np.array([point.geodetic for point, _, _ in found])) if found else np.full(3, np.nan)
    in_model = np.array([place for _, place, _ in found]).reshape(-1, 3)
    told = Survey(None, origin, pd.DataFrame(), tuple(notes), tuple(wrong_lines))
    enu_m = surveyed_m(np.array([point.geodetic for point, _, _ in found]).reshape(-1, 3), told)
    control = np.array([not point.check for point, _, _ in found], bool)
    table = pd.DataFrame(
        {
            "point": [point.name for point, _, _ in found],
            "role": np.where(control, "control", "check"),
            "marks": [int((off_px <= point.wrong_px).sum()) for point, _, off_px in found],
            "marks_px": [float(np.median(off_px[off_px <= point.wrong_px])) for point, _, off_px in found],
        }
    )
    told = replace(told, table=table)
    if problem := _cannot_tell(enu_m[control], "marked in two placed photographs or more"):
        return replace(told, problem=problem)
    pixel = np.array([_pixel_size(point, place) for point, place, _ in found])
    used = _without_wrong(in_model, enu_m, control, pixel)
    wrong = control & ~used
    fit = fit_similarity(in_model[used], enu_m[used])
    rms_m = float(np.sqrt(np.square(fit.apply(in_model[used]) - enu_m[used]).sum(axis=1).mean()))
    spread_m = float(np.sqrt(np.var(enu_m[used], axis=0).sum()))
    if rms_m > _MOST_DISAGREEMENT * spread_m or fit.scale <= 0:
        return replace(
            told,
            problem=f"they contradict the photographs by {rms_m:.1f} m where they spread over {spread_m:.1f} m: is a point "
            "marked in the wrong place, or named like another?",
        )
    residual_m = fit.apply(in_model) - enu_m
    error_m = _errors_without(in_model, enu_m, used)
    table = table.assign(
        role=np.where(wrong, "wrong", table["role"]), x_m=enu_m[:, 0], y_m=enu_m[:, 1], pixel_m=fit.scale * pixel
    )
    for axis, name in enumerate(AXES):
        table[f"residual_{name}_m"] = residual_m[:, axis]
        table[f"error_{name}_m"] = error_m[:, axis]
    return replace(told, world_from_model=fit, table=table)


def surveyed_m(geodetic: Float[np.ndarray, "n 3"], told: Survey) -> Float[np.ndarray, "n 3"]:
    """Return where points were surveyed (latitude, longitude, height): east, north and up of the survey's origin."""
    return enu_from_geodetic(geodetic, told.origin)


def located(point: Marked) -> tuple[Float[np.ndarray, " 3"], Float[np.ndarray, " m"], str]:
    """Return where most rays meet, how far from it each mark is, and why that is not to be used, if so."""
    nowhere = np.full(3, np.nan), np.full(len(point.rays), np.nan)
    if len(point.rays) < 2:
        few = (
            "fewer than two of its marks can be"
            if point.without_ray
            else "only one photograph that has a pose shows it"
        )
        return *nowhere, few
    best, least = None, np.inf
    for pair in combinations(range(0, len(point.rays), -(-len(point.rays) // _TRIED)), 2):
        place = _meeting(point.cam_from_model[list(pair)], point.rays[list(pair)])
        cost = np.minimum(_off_px(point, place) / point.wrong_px, 1).sum()
        if cost < least:
            best, least = place, cost
    if best is None:
        return *nowhere, "its rays do not meet"
    for _ in range(3):
        right = _off_px(point, best) <= point.wrong_px
        if right.sum() < 2:
            return *nowhere, "its marks contradict each other"
        best = _meeting(point.cam_from_model[right], point.rays[right])
    rays = best - centres(point.cam_from_model[right])
    rays /= np.linalg.norm(rays, axis=1, keepdims=True)
    if np.degrees(np.arccos(np.clip((rays @ rays.T).min(), -1, 1))) < _LEAST_ANGLE_DEG:
        return *nowhere, "it is seen from one direction only"
    return best, _off_px(point, best), ""


def _meeting(cam_from_model: Float[np.ndarray, "m 3 4"], rays: Float[np.ndarray, "m 2"]) -> Float[np.ndarray, " 3"]:
    """Return the point nearest to rays, by the distances in the pictures (iterated linear triangulation)."""
    rows = rays[..., None] * cam_from_model[:, 2:] - cam_from_model[:, :2]
    place = np.zeros(3)
    depth = np.ones(len(rays))
    for _ in range(4):  # distances in the pictures are those across the ray over the depth
        weighted = (rows / depth[:, None, None]).reshape(-1, 4)
        place = np.linalg.lstsq(weighted[:, :3], -weighted[:, 3], rcond=None)[0]
        depth = np.maximum(np.abs(_in_cameras(cam_from_model, place)[:, 2]), 1e-9)
    return place


def _off_px(point: Marked, place: Float[np.ndarray, " 3"]) -> Float[np.ndarray, " m"]:
    in_cam = _in_cameras(point.cam_from_model, place)
    behind = in_cam[:, 2] <= 0
    shown = in_cam[:, :2] / np.where(behind, 1.0, in_cam[:, 2])[:, None]
    return np.where(behind, np.inf, np.linalg.norm(shown - point.rays, axis=1) * point.focal_px)


def _in_cameras(cam_from_model: Float[np.ndarray, "m 3 4"], place: Float[np.ndarray, " 3"]) -> Float[np.ndarray, "m 3"]:
    return cam_from_model[:, :, :3] @ place + cam_from_model[:, :, 3]


def _cannot_tell(enu_m: Float[np.ndarray, "n 3"], what: str) -> str:
    """Say why points cannot tell the world; nothing, if they can."""
    if len(enu_m) < FEWEST:
        return f"{len(enu_m)} of them are {what}, {FEWEST} are needed"
    along, across, _ = np.linalg.svd(enu_m - enu_m.mean(axis=0), compute_uv=False)
    return "" if across >= _LEAST_ACROSS * along else "they lie on one line, about which the world could turn"


def _pixel_size(point: Marked, place: Float[np.ndarray, " 3"]) -> float:
    """Return how large a pixel is at a point, in the model's unit."""
    return float(np.median(_in_cameras(point.cam_from_model, place)[:, 2] / point.focal_px))


def _without_wrong(
    in_model: Float[np.ndarray, "n 3"],
    enu_m: Float[np.ndarray, "n 3"],
    control: Bool[np.ndarray, " n"],
    pixel: Float[np.ndarray, " n"],
) -> Bool[np.ndarray, " n"]:
    """Return the control points without those that the others contradict. pixel: its size at each, in the model's unit."""
    used = control.copy()
    for _ in range(int(control.sum()) // _FEWEST_TO_DOUBT):
        if used.sum() < _FEWEST_TO_DOUBT:
            break
        rms = {i: _rms(in_model, enu_m, used & (np.arange(len(used)) != i)) for i in np.flatnonzero(used)}
        worst = min(rms, key=lambda i: rms[i])
        without = used & (np.arange(len(used)) != worst)
        if rms[worst] * _WRONG_FACTOR > _rms(in_model, enu_m, used) or _cannot_tell(enu_m[without], ""):
            break
        fit = fit_similarity(in_model[without], enu_m[without])
        if np.linalg.norm(fit.apply(in_model[worst]) - enu_m[worst]) < WRONG_PX * fit.scale * pixel[worst]:
            break
        used = without
    return used


def _rms(in_model: Float[np.ndarray, "n 3"], enu_m: Float[np.ndarray, "n 3"], used: Bool[np.ndarray, " n"]) -> float:
    """Return the RMS residual of a fit for each degree of freedom that it leaves."""
    off = fit_similarity(in_model[used], enu_m[used]).apply(in_model[used]) - enu_m[used]
    return float(np.sqrt(np.square(off).sum() / (3 * used.sum() - 7)))


def _errors_without(
    in_model: Float[np.ndarray, "n 3"], enu_m: Float[np.ndarray, "n 3"], used: Bool[np.ndarray, " n"]
) -> Float[np.ndarray, "n 3"]:
    """Return each point's error in the world of the used ones but itself."""
    errors = np.full(enu_m.shape, np.nan)
    for i in range(len(enu_m)):
        others = used & (np.arange(len(used)) != i)
        if not _cannot_tell(enu_m[others], ""):
            errors[i] = fit_similarity(in_model[others], enu_m[others]).apply(in_model[i]) - enu_m[i]
    return errors
