"""The map of a mesh's errors from above: the truth, the reconstruction, and how far each lies from the other."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from jaxtyping import Float, UInt8
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from aug3d_core.geometry.ply import Mesh
from aug3d_core.geometry.raycast import Raycaster
from aug3d_core.town.truth.mesh_errors import MeshErrors

_PX = 700  # of the longer side
_PAPER = 245  # grey where there is no surface


def draw_error_map(errors: MeshErrors, true: Mesh, found: Mesh, extent_m: float, path: Path) -> None:
    """Write a PNG; distances are drawn up to 1 % of the extent, and the scale is marked at 0.5 %."""
    seen = errors.true_xyz[:, :2]
    if not len(seen):
        return
    (west, south), (east, north) = seen.min(axis=0), seen.max(axis=0)
    figure = Figure(figsize=(12, 7.4), layout="constrained")
    FigureCanvasAgg(figure)
    panels = figure.subplots(2, 2, sharex=True, sharey=True)
    frame = (west, east, south, north)
    panels[0, 0].imshow(_from_above(true, frame), extent=frame)
    panels[0, 0].set_title("the true town")
    panels[0, 1].imshow(_from_above(found, frame), extent=frame)
    panels[0, 1].set_title("the mesh")
    dots = None
    for axes, xyz, off_m, title in (
        (panels[1, 0], errors.found_xyz, errors.found_off_m, "mesh to truth (accuracy)"),
        (panels[1, 1], errors.true_xyz, errors.true_off_m, "truth to mesh (completeness)"),
    ):
        up = np.argsort(xyz[:, 2], kind="stable")  # roofs are drawn over what lies under them
        off = np.minimum(off_m[up], 1e9)
        dots = axes.scatter(*xyz[up, :2].T, c=off, s=2.5, lw=0, cmap="turbo", vmin=0, vmax=0.01 * extent_m)
        axes.set_title(f"{title}: median {np.median(off_m):.2f} m" if len(off_m) else f"{title}: nothing there")
        axes.set_facecolor("white")
    for axes in panels.flat:
        axes.set(xlim=(west, east), ylim=(south, north), aspect="equal")
    bar = figure.colorbar(dots, ax=panels, shrink=0.6, extend="max", label="distance [m]; the line is 0.5 % of extent")
    bar.ax.axhline(0.005 * extent_m, color="white", lw=2)
    figure.savefig(path, dpi=100, metadata={"Software": None})


def _from_above(mesh: Mesh, frame: tuple[float, float, float, float]) -> UInt8[np.ndarray, "h w 3"]:
    """Draw a mesh's colours as seen from straight above, north up."""
    if not len(mesh.triangles):
        return np.full((1, 1, 3), _PAPER, np.uint8)
    west, east, south, north = frame
    cell = max(east - west, north - south) / _PX
    x: Float[np.ndarray, " w"] = np.arange(west + cell / 2, east, cell)
    y: Float[np.ndarray, " h"] = np.arange(north - cell / 2, south, -cell)
    above = float(mesh.xyz[:, 2].max()) + 1.0
    origins = np.stack([*np.meshgrid(x, y), np.full((len(y), len(x)), above)], axis=-1)
    hits = Raycaster(mesh.xyz, mesh.triangles).cast(origins, np.array([0.0, 0.0, -1.0]))
    hit = hits.triangle >= 0
    image = np.full((*hit.shape, 3), _PAPER, np.uint8)
    corners = mesh.rgb[mesh.triangles[hits.triangle[hit]]]
    image[hit] = np.einsum("pk,pkc->pc", hits.weights[hit], corners.astype(np.float32)).clip(0, 255).astype(np.uint8)
    return image
