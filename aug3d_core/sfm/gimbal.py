"""Measure doming by how a drone hangs its camera: a gimbal holds the horizon level, and the pitch that was set.

In a flight that is bent like a bowl each camera is turned outward, in proportion to its distance from the middle: it rolls
where that is to its side, and pitches where that is ahead. So a bend is told without GPS, whichever way the cameras head. What
a pilot does with the pitch, as to look at one place from all around, is not followed by the roll: both must tell the same.
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Float

from aug3d_core.geometry.transforms import centres
from aug3d_core.sfm.doming import FEWEST, Doming, Sought, seek

_MOST_NOISE = float(np.radians(4.0))  # beyond it a camera was turned by hand
_LEAST_BESIDE = 0.2  # of the distances from the middle: what is to the sides of cameras that tell by their roll (RMS)
_TOLD_BY = "roll and pitch of the cameras"


def doming_by_gimbal(cam_from_world: Float[np.ndarray, "n 3 4"]) -> Doming | None:
    """Fit roll and pitch of the cameras, in the order of capture, by a lean of the world and a lean away from the middle.

    Scale and level of the world do not matter. None if there are too few, if they are in one place or all head to or from
    the middle, if they were turned by hand, or if roll and pitch contradict each other.
    """
    at, right, ahead = centres(cam_from_world), cam_from_world[:, 0, :3], cam_from_world[:, 2, :3]
    place = at[:, :2] - at[:, :2].mean(axis=0)
    extent, away = float(np.linalg.norm(np.ptp(place, axis=0))), float(np.sqrt((place**2).sum(axis=1).mean()))
    level = np.linalg.norm(right[:, :2], axis=1, keepdims=True)
    if len(at) < FEWEST or extent == 0 or not level.all():
        return None
    side = right[:, :2] / level
    front = np.column_stack([-side[:, 1], side[:, 0]])
    beside = (side * place).sum(axis=1) / extent
    if np.sqrt((beside**2).mean()) < _LEAST_BESIDE * away / extent:
        return None
    # A camera that looks to the horizon does not pitch, where one that looks down does
    before = -ahead[:, 2] * (front * place).sum(axis=1) / extent
    roll = _lean(beside, side, right[:, 2])
    pitch = _lean(before, front, (ahead[:, :2] * front).sum(axis=1))
    if roll is None or pitch is None or max(roll.noise, pitch.noise) > _MOST_NOISE:
        return None
    by_roll, by_pitch = _doming(roll), _doming(pitch)
    if by_roll.contradicts(by_pitch):
        return None
    told = np.array([[one.pct, one.sigma_pct] for one in (by_roll, by_pitch)])
    weight = 1 / np.maximum(told[:, 1], 1e-9) ** 2
    return Doming(float(weight @ told[:, 0] / weight.sum()), float(weight.sum() ** -0.5), _TOLD_BY)


def _lean(
    away: Float[np.ndarray, " n"], heading: Float[np.ndarray, "n 2"], leant: Float[np.ndarray, " n"]
) -> Sought | None:
    return seek(np.column_stack([away, np.ones(len(away)), heading]), leant, 1e-9)


def _doming(lean: Sought) -> Doming:
    to_pct = 100 / 8  # of a parabola that leans by its term times the distance over the extent
    return Doming(to_pct * float(lean.terms[0]), to_pct * lean.sigma, _TOLD_BY)
