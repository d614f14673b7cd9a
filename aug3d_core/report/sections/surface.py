"""Depth of the photographs, and the mesh beside them."""

from __future__ import annotations

from aug3d_core.report.html import number, percent, tag
from aug3d_core.report.reported_run import ReportedRun


def depth_and_mesh(run: ReportedRun) -> str:
    """Return the depth maps and the mesh of one fold, and how well they fit the photographs."""
    said = {"Depth": _depth(run), "Mesh": _mesh(run), "Against ground truth": _truth(run)}
    words = "".join(tag("div", tag("h3", name) + tag("p", text)) for name, text in said.items() if text)
    pictures = run.pictures("surface") + run.pictures("depth") + run.pictures("mesh_truth")
    return tag("div", words, class_="tables") + tag("div", pictures, class_="card pictures") if words else ""


def _depth(run: ReportedRun) -> str:
    record = run.record("depth")
    if record is None:
        return ""
    m = record.metrics
    return (
        f"{number(m.get('photos'))} depth maps of {number(m.get('depth_width_px'))} px by {number(m.get('engine'))};"
        f" {tag('b', percent(run.figure('depth', 'consistent_share'), 1))} of the pixels are confirmed by another photograph;"
        f" {number(m.get('baseline_points'))} fused points."
    )


def _mesh(run: ReportedRun) -> str:
    record = run.record("surface")
    if record is None:
        return ""
    m = record.metrics
    return (
        f"{number(m.get('baseline_triangles'))} triangles from all photographs except the held-out ones,"
        f" {number(m.get('triangles'))} from the training photographs only. Held-out photographs against the mesh:"
        f" {tag('b', number(run.figure('surface', 'target_render_psnr_full'), 3))} dB at full size, over the"
        f" {percent(run.figure('surface', 'target_covered_share_full'), 1)} that it covers."
        f" {percent(run.figure('surface', 'baseline_bridged_share'), 1)} of the surface has no points: closed gaps, and"
        " ground and walls that photographs do not see, which are made up."
    )


def _truth(run: ReportedRun) -> str:
    record = run.record("mesh_truth")
    if record is None:
        return ""
    half, one = (run.figure("mesh_truth", f"fscore_{bound}_pct") for bound in ("half", "one"))
    return (
        f"F-score {tag('b', number(half, 3))} at 0.5 % of the extent of {number(record.metrics.get('extent_m'), 3)} m,"
        f" {number(one, 3)} at 1 %."
    )
