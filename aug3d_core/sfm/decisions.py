"""What matching and sfm decide by themselves."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from aug3d_core.run.stage import AS_SET, Decision

_PAIRS = {
    "exhaustive": "few photographs: all pairs are compared",
    "gps": "neighbours by GPS, which the photographs bear out",
    "gps and coarse": "neighbours by GPS, and by likeness for the photographs that do not bear it out",
    "coarse": "no GPS to go by: a coarse comparison of all pairs tells which look alike",
}
_UP = {
    "control": "ground control points tell the world",
    "gps": "GPS altitudes fix the vertical well",
    "gravity": "from how the cameras hang and the ground lies",
}
_AS_BEFORE = "as in the earlier version"


def matching_decisions(metrics: Mapping[str, Any]) -> Iterator[Decision]:
    """Yield how many pairs of photographs are compared."""
    tried, possible, by = metrics["pairs_tried"], metrics["pairs_possible"], metrics["pairs_by"]
    yield Decision(
        field="matching.pairs",
        value=f"{tried:,.0f} of {possible:,.0f}, by {by}",
        measured=f"{metrics['photos']} photographs, {metrics['photos_doubted_gps']} whose GPS they do not bear out",
        rule=_PAIRS[by],
        saves=f"{1 - tried / possible:.0%} of the comparisons" if tried < possible else "",
    )


def sfm_decisions(metrics: Mapping[str, Any]) -> Iterator[Decision]:
    """Yield how poses were found, and with which lens; only lens and vertical if the poses were given."""
    if "mapper" in metrics:
        reason = metrics["mapper_reason"] or AS_SET
        yield Decision(field="sfm.mapper", value=metrics["mapper"], measured="", rule=reason)
    if metrics.get("grown_from"):
        yield Decision(
            field="sfm.poses",
            value=f"{metrics['poses_kept']} kept as they were" if metrics["poses_kept"] else "all adjusted together",
            measured=metrics["poses_reason"],
            rule="earlier ones stay if at most a quarter is new, and new photographs and GPS fit them as well as others",
        )
    yield Decision(
        field="sfm.camera_model",
        value=metrics["camera_model"],
        measured=_held_out(metrics),
        rule="the simplest whose error on held-out observations is near the best"
        + (", RADIAL where a bend is taken out" if metrics.get("doming_taken_out_pct") else ""),
    )
    if metrics.get("focal_source"):
        ratio, moved = metrics["focal_exif_over_refined_error"], 100 * (metrics["focal_moved_share"] or 0.0)
        yield Decision(
            field="sfm.focal",
            value=f"{metrics['focal_px']:,.1f} px, {metrics['focal_source']}",
            measured=(_AS_BEFORE if metrics.get("grown_from") else "photographs state none")
            if ratio is None
            else f"held-out error with that of EXIF is {ratio:.2f} times that with a fitted one, {moved:.2g} % off",
            rule="what photographs state, unless a fitted one gains half of what it moves, and 2 %",
        )
    if (light := metrics.get("corner_light")) is not None:
        yield Decision(
            field="sfm.falloff",
            value="evened out" if metrics["light_evened"] else "left as it is",
            measured=f"corners have {light:.1%} of the light of the middle, give or take {metrics['corner_light_sigma']:.1%}",
            rule="evened out where corners surely lose 3 %",
        )
    if up := metrics["up_from"]:
        yield Decision(
            field="sfm.up",
            value=up,
            measured=_UP[up],
            rule="control points, else GPS where it is well spread, else gravity",
        )
    if (bend_pct := metrics.get("doming_taken_out_pct")) is not None:
        yield Decision(
            field="sfm.bend",
            value="taken out of poses and lens",
            measured=f"poses from photographs alone are bent by {bend_pct:+.3g} ± {metrics['doming_taken_out_sigma_pct']:.2g} "
            f"% of the flight's extent, as {metrics['doming_taken_out_by']} tell",
            rule="taken out where it is three times its error, and photographs fit as well without",
        )
    if (adjusted_m := metrics.get("control_left_out_m_adjusted")) is not None:
        yield Decision(
            field="sfm.control",
            value="poses adjusted to control points" if metrics["control_adjusted"] else "the world moved as a whole",
            measured=f"points that had no part are {adjusted_m:.3f} m off after adjustment, "
            f"{metrics['control_left_out_m_moved']:.3f} m by moving alone",
            rule="adjusted where points that had no part gain a fifth",
        )


def _held_out(metrics: Mapping[str, Any]) -> str:
    """Return the held-out error of each camera model, with the focal length that was chosen."""
    start, end = "heldout_px_", f"_{metrics.get('focal_source')}"
    said = ", ".join(
        f"{name.removeprefix(start).removesuffix(end).upper()} {error:.3g}"
        for name, error in metrics.items()
        if name.startswith(start) and name.endswith(end) and error is not None
    )
    if not said and metrics.get("grown_from"):
        return _AS_BEFORE
    return f"{said} px" if said else "nothing to tell it by: the simplest, or as given"
