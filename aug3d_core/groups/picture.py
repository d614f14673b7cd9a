"""The pictures that people look at: the similarity matrix, and the map of roles and groups."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from jaxtyping import Float, Int
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import LineCollection
from matplotlib.colors import LogNorm
from matplotlib.figure import Figure
from scipy import sparse

from aug3d_core.split.split import Role, Split

_ROLE_COLOURS = {
    Role.TRAIN: "tab:blue",
    Role.SPARE: "white",
    Role.GAP: "lightgrey",
    Role.SUPPORT: "tab:orange",
    Role.TARGET: "tab:red",
}
_MOST_PIXELS = 1500
_GROUPS_DRAWN = 8


def draw_similarity(shared: sparse.csr_array, path: Path) -> None:
    """Write the matrix as a heat map in capture order, logarithmic; white where nothing is shared."""
    views = len(shared.diagonal())
    step = max(1, views // _MOST_PIXELS)
    values = shared[::step, ::step].toarray().astype(float)
    figure = Figure(figsize=(7, 6), layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.add_subplot()
    extent = (0, views, views, 0)
    scale = LogNorm(1, max(2, values.max()))
    image = axes.imshow(np.where(values > 0, values, np.nan), norm=scale, extent=extent, interpolation="nearest")
    axes.set(xlabel="view, in capture order", ylabel="view, in capture order", title="Points that two views share")
    figure.colorbar(image, label="shared points")
    figure.savefig(path, dpi=100, metadata={"Software": None})


def draw_grouping(
    centres_in_world: Float[np.ndarray, "n 2"],
    look_in_world: Float[np.ndarray, "n 2"],
    split: Split,
    members: Int[np.ndarray, "c k"],
    method: str,
    path: Path,
) -> None:
    """Write two maps side by side: the cameras of each role, and those of the first groups."""
    figure = Figure(figsize=(13, 6.5), layout="constrained")
    FigureCanvasAgg(figure)
    roles, groups = figure.subplots(1, 2)
    for role, colour in _ROLE_COLOURS.items():
        chosen = split.views(role)
        if role == Role.SPARE and not len(chosen):
            continue
        at, look = centres_in_world[chosen], look_in_world[chosen]
        roles.add_collection(LineCollection([*np.stack([at, look], axis=1)], colors=colour, linewidths=1, alpha=0.5))
        label = f"{role} ({len(chosen)})"
        roles.scatter(*at.T, s=30, color=colour, edgecolors="black", linewidths=0.4, label=label, zorder=3)
    roles.legend()
    roles.set(title="Roles: cameras, and where they look")
    roles.set_aspect("equal", adjustable="datalim")
    groups.scatter(*centres_in_world.T, s=12, color="lightgrey")
    drawn = min(len(members), _GROUPS_DRAWN)
    for number, group in enumerate(members[:drawn]):
        at, colour, size = centres_in_world[group], f"C{number}", 14 + 22 * (drawn - number)
        lines = np.stack([at, look_in_world[group]], axis=1)
        groups.add_collection(LineCollection([*lines], colors=colour, linewidths=1, alpha=0.6))
        groups.scatter(*at.T, s=size, color=colour, linewidths=0, zorder=3 + number)  # a ring for each group it is in
        groups.scatter(*at[0], s=160, marker="*", color=colour, edgecolors="black", zorder=20)
    groups.set(title=f"{drawn} of {len(members)} groups by {method}: cameras, and where they look")
    groups.set_aspect("equal", adjustable="datalim")
    figure.savefig(path, dpi=100, metadata={"Software": None})
