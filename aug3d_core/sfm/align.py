"""Bring a reconstruction, whose frame and scale are arbitrary, into the project's world.

With ground control points: ENU metres about their middle. With GPS: about the photographs' median position. Without: z up and a
nominal scale, in which the median camera flies 50 units above the ground, about as high as drones do, so that settings in
metres stay sensible. In all, z = 0 is the ground. Plain numpy.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from aug3d_core.geometry.robust import spread
from aug3d_core.geometry.similarity import Similarity, fit_similarity_robustly
from aug3d_core.geometry.transforms import centres
from aug3d_core.geometry.up_direction import fit_up, ground_height, rotation_to_z, up_from_cameras

NOMINAL_HEIGHT = 50.0
_GROUND_THICKNESS = 0.02  # of the median distance from cameras to points
_MOST_TILT_DEG = 1.5  # uncertainty of the vertical at which GPS altitudes are worth less than the ground's own level
_ALTITUDE_NOISE_M = 0.3  # the least to believe of any GPS
_FEWEST_ALTITUDES = 3  # that fix a similarity; how well is in their noise
_MOST_DISAGREEMENT = 0.25  # median GPS residual over the spread of the positions
_LEAST_MIRRORED = 0.02  # the same ratio at which latitude and longitude may be swapped
_MIRRORED_BETTER = 2.0  # times that the swapped positions fit better
_BETTER = 0.7  # times the residual at which GPS tells the ground from a wall that holds more points
_MOST_LEAN_DEG = 3.0  # between the verticals of GPS altitudes and ground at which the cameras' horizons decide


@dataclass(frozen=True)
class Alignment:
    """How the world was found.

    world_from_model: the similarity to apply. up_from: control points, gps, or gravity (cameras and ground). residual_m:
    horizontal distance of each camera to its GPS position, NaN without. up_offset_m: height of z = 0 about the origin that
    positions were given about, NaN without altitudes. problem: why GPS that exists was not used.
    """

    world_from_model: Similarity
    metric: bool
    up_from: str
    residual_m: Float[np.ndarray, " n"]
    up_offset_m: float
    problem: str = ""


def align(
    cam_from_model: Float[np.ndarray, "n 3 4"],
    points_in_model: Float[np.ndarray, "p 3"],
    median_depth: float,
    gps_enu_m: Float[np.ndarray, "n 3"],
    rng: np.random.Generator,
    swapped_enu_m: Float[np.ndarray, "n 3"] | None = None,
) -> Alignment:
    """Find the world; rows of `gps_enu_m` are NaN without GPS, and up is NaN where GPS has no altitude.

    swapped_enu_m: the positions with latitude and longitude exchanged, tried only to explain positions that do not fit.
    """

    def level_near(guess: Float[np.ndarray, " 3"], rng: np.random.Generator) -> Similarity:
        up = fit_up(points_in_model, guess, _GROUND_THICKNESS * median_depth, rng)
        return Similarity(1.0, rotation_to_z(up), np.zeros(3))

    level = level_near(up_from_cameras(cam_from_model), rng)
    located = np.isfinite(gps_enu_m[:, 0])
    problem = ""
    if located.sum() >= 3:
        fit, up_from = _fit_gps(cam_from_model[located], gps_enu_m[located], level, level_near, rng)
        residual_m = np.linalg.norm((fit.apply(centres(cam_from_model)) - gps_enu_m)[:, :2], axis=1)
        spread_m = float(np.sqrt(gps_enu_m[located, :2].var(axis=0).sum()))
        disagreement = np.nanmedian(residual_m) / spread_m if spread_m > 0 else np.inf
        if disagreement > _LEAST_MIRRORED and swapped_enu_m is not None:
            flat = level.apply(centres(cam_from_model))[located, :2]
            if _disagreement(flat, swapped_enu_m[located, :2], rng) * _MIRRORED_BETTER < disagreement:
                problem = "latitude and longitude look swapped: exchanged, the positions fit the photographs"
        if not problem and disagreement < _MOST_DISAGREEMENT:
            return _metric(fit, up_from, residual_m, cam_from_model, points_in_model, gps_enu_m)
        problem = problem or (
            f"the GPS positions contradict the photographs: median residual {np.nanmedian(residual_m):.1f} m where the "
            f"positions spread over {spread_m:.1f} m"
        )
    elif located.any():
        problem = f"only {located.sum()} of the placed photographs have GPS, 3 are needed"
    fit = _nominal(level, cam_from_model, points_in_model, median_depth)
    return Alignment(fit, False, "gravity", np.full(len(gps_enu_m), np.nan), np.nan, problem)


def align_to_control(
    cam_from_world: Float[np.ndarray, "n 3 4"],
    points_in_world: Float[np.ndarray, "p 3"],
    gps_enu_m: Float[np.ndarray, "n 3"],
) -> Alignment:
    """Put the ground of the world that control points tell to z = 0; positions are about the same origin."""
    ground_m = ground_height(points_in_world[:, 2])
    residual_m = np.linalg.norm((centres(cam_from_world) - gps_enu_m)[:, :2], axis=1)
    return Alignment(
        _lower(Similarity(1.0, np.eye(3), np.zeros(3)), ground_m), True, "control", residual_m, float(ground_m)
    )


def _disagreement(
    flat: Float[np.ndarray, "n 2"], positions_m: Float[np.ndarray, "n 2"], rng: np.random.Generator
) -> float:
    """Return the median distance of the level cameras to the positions, over the spread of these."""
    fit, _ = fit_similarity_robustly(flat, positions_m, rng)
    residual_m = np.linalg.norm(fit.apply(flat) - positions_m, axis=1)
    return float(np.median(residual_m) / max(np.sqrt(positions_m.var(axis=0).sum()), 1e-9))


def _fit_gps(
    cam_from_model: Float[np.ndarray, "n 3 4"],
    gps_enu_m: Float[np.ndarray, "n 3"],
    level: Similarity,
    level_near: Callable[[Float[np.ndarray, " 3"], np.random.Generator], Similarity],
    rng: np.random.Generator,
) -> tuple[Similarity, str]:
    """Fit all three axes where that fixes the vertical well, else the horizontal ones, the vertical left to gravity.

    level: by the plane that most points are in, which is a wall's where cameras of one heading look at it: then the plane near
    the vertical of rough altitudes is tried too.
    """
    centres_in_model = centres(cam_from_model)
    measured = np.isfinite(gps_enu_m[:, 2])
    if measured.sum() >= _FEWEST_ALTITUDES:
        there_m = gps_enu_m[measured]
        fit, used = fit_similarity_robustly(centres_in_model[measured], there_m, rng)
        up_noise_m = spread((fit.apply(centres_in_model[measured]) - there_m)[used, 2])
        across_m = np.linalg.svd(there_m[used, :2] - there_m[used, :2].mean(axis=0), compute_uv=False)[-1]
        tilt_deg = np.degrees(np.arctan2(max(up_noise_m, _ALTITUDE_NOISE_M), across_m))
        if tilt_deg <= _MOST_TILT_DEG and fit.scale > 0 and not _leans(cam_from_model, fit, level):
            return fit, "gps"
        by_ground = _fit_level(centres_in_model, gps_enu_m, level, rng)
        if up_from_cameras(cam_from_model) @ fit.rotation[2] <= 0:  # mirrored positions turn the world upside down
            return by_ground, "gravity"
        apart = rng.spawn(1)[0]  # whatever is tried, what follows is drawn alike
        other = _fit_level(centres_in_model, gps_enu_m, level_near(fit.rotation[2], apart), apart)
        off_m, other_off_m = (
            float(np.median(np.linalg.norm(one.apply(centres_in_model[measured]) - there_m, axis=1)))
            for one in (by_ground, other)
        )
        return (other if other_off_m < _BETTER * off_m else by_ground), "gravity"
    return _fit_level(centres_in_model, gps_enu_m, level, rng), "gravity"


def _fit_level(
    centres_in_model: Float[np.ndarray, "n 3"],
    gps_enu_m: Float[np.ndarray, "n 3"],
    level: Similarity,
    rng: np.random.Generator,
) -> Similarity:
    """Fit the horizontal axes of a level model, and its height where any altitude is known."""
    measured = np.isfinite(gps_enu_m[:, 2])
    flat, _ = fit_similarity_robustly(level.apply(centres_in_model)[:, :2], gps_enu_m[:, :2], rng)
    rotation = np.eye(3)
    rotation[:2, :2] = flat.rotation
    up_m = gps_enu_m[:, 2] - flat.scale * level.apply(centres_in_model)[:, 2]
    shift_m = np.append(flat.translation, np.median(up_m[measured]) if measured.any() else 0.0)
    return Similarity(flat.scale, rotation, shift_m).after(level)


def _leans(cam_from_model: Float[np.ndarray, "n 3 4"], fit: Similarity, level: Similarity) -> bool:
    """Tell whether altitudes that drift lean the world: level ground is then a slope, and level cameras roll.

    On a true slope it is the other way round: cameras hang level, and would roll if the ground were.
    """
    by_gps, by_ground = fit.rotation[2], level.rotation[2]
    if np.degrees(np.arccos(np.clip(by_gps @ by_ground, -1, 1))) <= _MOST_LEAN_DEG:
        return False
    right = cam_from_model[:, 0, :3]
    return bool(np.median(np.abs(right @ by_gps)) > 2 * np.median(np.abs(right @ by_ground)))


def _metric(
    fit: Similarity,
    up_from: str,
    residual_m: Float[np.ndarray, " n"],
    cam_from_model: Float[np.ndarray, "n 3 4"],
    points_in_model: Float[np.ndarray, "p 3"],
    gps_enu_m: Float[np.ndarray, "n 3"],
) -> Alignment:
    ground_m = ground_height(fit.apply(points_in_model)[:, 2])
    world = _lower(fit, ground_m)
    measured = np.isfinite(gps_enu_m[:, 2])
    off_m = (gps_enu_m - world.apply(centres(cam_from_model)))[measured, 2]
    return Alignment(world, True, up_from, residual_m, float(np.median(off_m)) if measured.any() else np.nan)


def _nominal(
    level: Similarity,
    cam_from_model: Float[np.ndarray, "n 3 4"],
    points_in_model: Float[np.ndarray, "p 3"],
    median_depth: float,
) -> Similarity:
    points = level.apply(points_in_model)
    height = np.median(level.apply(centres(cam_from_model))[:, 2]) - ground_height(points[:, 2])
    # Cameras carried at ground level have no height to speak of; what they see at 50 units is as good a scale.
    scale = float(NOMINAL_HEIGHT / (height if height > 0.1 * median_depth else median_depth))
    middle = np.append(np.median(points[:, :2], axis=0), ground_height(points[:, 2]))
    return Similarity(scale, level.rotation, -scale * middle)


def _lower(fit: Similarity, height: float) -> Similarity:
    return Similarity(fit.scale, fit.rotation, fit.translation - np.array([0.0, 0.0, height]))
