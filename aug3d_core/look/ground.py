"""Where photographs were taken and what ground they show, as far as headers and pictures tell."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import cv2
import numpy as np
from jaxtyping import Bool, Float, Int
from scipy import sparse
from scipy.spatial import KDTree

from aug3d_core.geometry.geodesy import enu_from_geodetic, middle_of
from aug3d_core.look.glance import Glance
from aug3d_core.look.neighbours import Step

_AROUND = 3  # photographs before and after one that say where it should be
_WILD_STEPS, _WILD_M, _WILD_UP_M = (
    10.0,
    50.0,
    60.0,
)  # farther away than both of the first two, or than the last in height
_LEAST_MOVED, _LEAST_OVERLAP = 0.05, 0.3  # of a step that tells how large the ground in a picture is
_ALIKE = 0.25  # by how much the scale of such a step may differ from 1
_CONTRADICTS = 4.0  # widths of ground that a position is off, where the pictures overlap
_USUAL_FOCAL = 0.8  # of the width: of most drones, where no header tells
_OBLIQUE_DEG = -70.0  # pitch above which a picture is no map of the ground
_FARTHEST = 4.0  # heights: so far away what oblique photographs show still counts
_CELLS = 160  # along the longer side of the map
_FEW = 3  # photographs that must see a place: two give depth, a third checks it


@dataclass(frozen=True)
class Ground:
    """A map in metres east and north of the middle of the flight.

    enu_m: of cameras, NaN without a position. wild: positions that cannot be right. yaw_deg: clockwise from north, NaN if
    unknown. height_m: above the ground. width_m: of the ground that a photograph shows. height_from: what told the heights, ""
    if nothing. corners_m: of the ground that each shows, NaN if unknown. seen: by how many photographs, per cell from the
    south-west, [north, east]. inside: cells that the flight encloses.
    """

    enu_m: Float[np.ndarray, "n 3"]
    wild: Bool[np.ndarray, " n"]
    yaw_deg: Float[np.ndarray, " n"]
    height_m: Float[np.ndarray, " n"]
    width_m: float
    height_from: str
    corners_m: Float[np.ndarray, "n 4 2"]
    seen: Int[np.ndarray, "y x"]
    inside: Bool[np.ndarray, "y x"]
    low_m: Float[np.ndarray, " 2"]
    cell_m: float

    @property
    def placed(self) -> Bool[np.ndarray, " n"]:
        """Which photographs have a position that may be right."""
        return np.isfinite(self.enu_m[:, 0]) & ~self.wild

    @cached_property
    def common(self) -> sparse.csr_array:
        """How much of the ground that a photograph shows another one shows too, for all pairs that have any in common."""
        whole = np.flatnonzero(np.isfinite(self.corners_m).all(axis=(1, 2)))
        corners = self.corners_m[whole].astype(np.float32)
        middle = corners.mean(axis=1)
        reach = float(np.linalg.norm(corners - middle[:, None], axis=-1).max(initial=0.0))
        pairs = KDTree(middle).query_pairs(2 * reach, output_type="ndarray") if len(whole) else np.zeros((0, 2), int)
        area = np.array([cv2.contourArea(one) for one in corners]).clip(1e-9)
        both = np.array([cv2.intersectConvexConvex(corners[i], corners[j])[0] for i, j in pairs])
        ends, size = whole[np.concatenate([pairs, pairs[:, ::-1]])], (len(self.corners_m),) * 2
        shares = np.concatenate([both / area[pairs[:, 0]], both / area[pairs[:, 1]]])
        return sparse.csr_array((shares, (ends[:, 0], ends[:, 1])), shape=size)

    @property
    def gaps(self) -> Bool[np.ndarray, "y x"]:
        """Cells that too few photographs see."""
        return self.inside & (self.seen < _FEW)


def ground_of(photos: Sequence[Glance], steps: Sequence[Step]) -> Ground | None:
    """Return the map of a flight; None where fewer than two photographs have a position."""
    geodetic = np.array([[p.exif.lat_deg, p.exif.lon_deg, p.exif.alt_m] for p in photos]).reshape(-1, 3)
    known = np.isfinite(geodetic[:, 0])
    if known.sum() < 2:
        return None
    level = np.where(np.isfinite(geodetic[:, 2]), geodetic[:, 2], _median(geodetic[:, 2]))
    geodetic = np.column_stack([geodetic[:, :2], np.nan_to_num(level)])
    enu_m = np.full((len(photos), 3), np.nan)
    enu_m[known] = enu_from_geodetic(geodetic[known], middle_of(geodetic[known]))
    step_m = np.array([np.linalg.norm(b - a) for a, b in zip(enu_m[:-1, :2], enu_m[1:, :2], strict=True)])
    wild = _wild(enu_m, step_m)
    width_m = _width(steps, step_m)
    wild |= _contradicted(steps, step_m, width_m)
    wild &= not wild[known].all()  # such as two at each of two far places: nothing says which is right
    yaw_deg = _yaws(photos, steps, enu_m)
    height_m, height_from = _heights(photos, width_m)
    if not np.isfinite(width_m):
        width_m = _median(height_m / _focals(photos))
    corners_m = _corners(photos, enu_m, yaw_deg, height_m)
    corners_m[wild] = np.nan  # where they look is as wrong as where they are
    return Ground(enu_m, wild, yaw_deg, height_m, width_m, height_from, corners_m, *_coverage(corners_m, width_m))


def _wild(enu_m: Float[np.ndarray, "n 3"], step_m: Float[np.ndarray, " m"]) -> Bool[np.ndarray, " n"]:
    """Return which positions lie far from those of the photographs before and after them."""
    usual_m = np.nan_to_num(_median(step_m))
    far_m = max(_WILD_STEPS * float(usual_m), _WILD_M)
    wild = np.zeros(len(enu_m), bool)
    known = np.flatnonzero(np.isfinite(enu_m[:, 0]))
    for at, photo in enumerate(known):
        others = [known[i] for i in range(max(at - _AROUND, 0), min(at + _AROUND + 1, len(known))) if i != at]
        off = enu_m[photo] - np.median(enu_m[others], axis=0)
        wild[photo] = len(others) > 1 and (np.hypot(*off[:2]) > far_m or abs(off[2]) > _WILD_UP_M)
    return wild


def _width(steps: Sequence[Step], step_m: Float[np.ndarray, " m"]) -> float:
    """Return how many metres of ground a picture is wide: by how far it moves while the drone flies so many metres."""
    tells = [
        metres / step.length
        for step, metres in zip(steps, step_m, strict=True)
        if metres > 0 and step.overlap > _LEAST_OVERLAP and step.length > _LEAST_MOVED and abs(step.scale - 1) < _ALIKE
    ]
    return _median(np.array(tells))


def _median(values: Float[np.ndarray, " n"]) -> float:
    """Return the median of those that are known; NaN if none is."""
    known = values[np.isfinite(values)]
    return float(np.median(known)) if len(known) else float("nan")


def _contradicted(steps: Sequence[Step], step_m: Float[np.ndarray, " m"], width_m: float) -> Bool[np.ndarray, " n"]:
    """Return which positions lie far from those of all neighbours with which their pictures overlap."""
    says = [step.overlap > _LEAST_OVERLAP and np.isfinite(metres) for step, metres in zip(steps, step_m, strict=True)]
    far = [said and metres > _CONTRADICTS * width_m for said, metres in zip(says, step_m, strict=True)]
    around = [(slice(max(i - 1, 0), i + 1)) for i in range(len(steps) + 1)]
    return np.array([sum(says[one]) == 2 and all(far[one]) for one in around], bool)


def _yaws(photos: Sequence[Glance], steps: Sequence[Step], enu_m: Float[np.ndarray, "n 3"]) -> Float[np.ndarray, " n"]:
    """Return where the upper edge of each picture points: by how picture and drone move together, or by its header.

    Pictures first, as long as they look down: some were turned later, and their header does not know.
    """
    yaw = np.full(len(photos), np.nan)
    for i, step in enumerate(steps):
        east, north, _ = enu_m[i + 1] - enu_m[i]
        if step.length > _LEAST_MOVED and step.overlap > _LEAST_OVERLAP and np.hypot(east, north) > 0:
            flown, shown = np.arctan2(east, north), np.arctan2(-step.moved[0], step.moved[1])
            told = np.degrees([flown - shown + step.turned_rad, flown - shown])
            yaw[i : i + 2] = np.where(np.isfinite(yaw[i : i + 2]), yaw[i : i + 2], told)
    header = np.array([photo.attitude.yaw_deg for photo in photos])
    oblique = np.array([photo.attitude.pitch_deg > _OBLIQUE_DEG for photo in photos])
    return np.where(np.isfinite(header) & (oblique | np.isnan(yaw)), header, yaw)


def _focals(photos: Sequence[Glance]) -> Float[np.ndarray, " n"]:
    """Return focal lengths as shares of the width."""
    focal = np.array([photo.exif.focal_px / photo.original_size[0] for photo in photos])
    known = focal[np.isfinite(focal)]
    return np.where(np.isfinite(focal), focal, np.median(known) if len(known) else _USUAL_FOCAL)


def _heights(photos: Sequence[Glance], width_m: float) -> tuple[Float[np.ndarray, " n"], str]:
    """Return heights above the ground, and what told them."""
    told = np.array([photo.attitude.above_start_m for photo in photos])
    told = np.where(told > 1, told, np.nan)
    if np.isfinite(told).any():
        return np.where(np.isfinite(told), told, _median(told)), "the drone's height above its start"
    if np.isfinite(width_m):
        return width_m * _focals(photos), "how far pictures move from one position to the next"
    return np.full(len(photos), np.nan), ""


def _corners(
    photos: Sequence[Glance],
    enu_m: Float[np.ndarray, "n 3"],
    yaw_deg: Float[np.ndarray, " n"],
    height_m: Float[np.ndarray, " n"],
) -> Float[np.ndarray, "n 4 2"]:
    """Return the corners of the level ground that each photograph shows: those of its picture, from the upper left."""
    pitch = np.array([photo.attitude.pitch_deg for photo in photos])
    pitch = np.radians(np.where(np.isfinite(pitch), pitch, -90.0))
    yaw = np.radians(np.where(np.isfinite(yaw_deg), yaw_deg, 0.0))
    ahead = np.stack([np.sin(yaw) * np.cos(pitch), np.cos(yaw) * np.cos(pitch), np.sin(pitch)], axis=-1)
    right = np.stack([np.cos(yaw), -np.sin(yaw), np.zeros_like(yaw)], axis=-1)
    down = np.cross(ahead, right)
    tall = np.array([photo.original_size[1] / photo.original_size[0] for photo in photos])
    focal = _focals(photos)
    signs = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) / 2
    rays = ahead[:, None] * focal[:, None, None] + right[:, None] * signs[:, :1]
    rays = rays + down[:, None] * (signs[:, 1:] * tall[:, None, None])
    fall = np.maximum(-rays[..., 2], np.hypot(*np.moveaxis(rays[..., :2], -1, 0)) / _FARTHEST)
    return enu_m[:, None, :2] + rays[..., :2] * (height_m[:, None] / np.maximum(fall, 1e-9))[..., None]


def _coverage(
    corners_m: Float[np.ndarray, "n 4 2"], width_m: float
) -> tuple[Int[np.ndarray, "y x"], Bool[np.ndarray, "y x"], Float[np.ndarray, " 2"], float]:
    """Return how many photographs see each cell, which cells the flight encloses, the map's south-west, and a cell's side.

    Enclosed: within the seen ground once holes up to a picture's width are closed, and half a picture from its edge, where
    photographs thin out on every flight.
    """
    whole = corners_m[np.isfinite(corners_m).all(axis=(1, 2))]
    if not len(whole) or not np.isfinite(width_m):
        return np.zeros((1, 1), int), np.zeros((1, 1), bool), np.zeros(2), 1.0
    low, high = whole.min(axis=(0, 1)), whole.max(axis=(0, 1))
    cell = max(float((high - low).max()) / _CELLS, 1e-6)
    columns, rows = np.ceil((high - low) / cell).astype(int) + 1
    seen = np.zeros((rows, columns), int)
    for corners in whole:
        one = np.zeros((rows, columns), np.uint8)
        cv2.fillConvexPoly(one, np.rint((corners - low) / cell).astype(np.int32), (1.0,))
        seen += one
    reach = max(round(width_m / 2 / cell), 1)
    disc = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (2 * reach + 1, 2 * reach + 1))
    padded = np.pad((seen > 0).astype(np.uint8), 2 * reach)
    inside = cv2.erode(cv2.morphologyEx(padded, cv2.MORPH_CLOSE, disc), disc)
    return seen, inside[2 * reach : -2 * reach, 2 * reach : -2 * reach] > 0, low, cell
