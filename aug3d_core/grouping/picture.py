"""The pictures that people look at: the similarity matrix, and the map of roles and groups."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from jaxtyping import Float, Int
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.colors import LogNorm
from matplotlib.figure import Figure
from scipy import sparse

from aug3d_core.grouping.split import Role, Split

_ROLE_COLOURS = {Role.TRAIN: "tab:blue", Role.GAP: "lightgrey", Role.SUPPORT: "tab:orange", Role.TARGET: "tab:red"}
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
    path: Path,
) -> None:
    """Write two maps side by side: where the views of each role look, and the members of the first groups."""
    figure = Figure(figsize=(13, 6.5), layout="constrained")
    FigureCanvasAgg(figure)
    roles, groups = figure.subplots(1, 2)
    for role, colour in _ROLE_COLOURS.items():
        chosen = split.views(role)
        at, look = centres_in_world[chosen], look_in_world[chosen]
        roles.plot(*np.stack([at, look]).transpose(2, 0, 1), color=colour, lw=1, alpha=0.5)
        label = f"{role} ({len(chosen)})"
        roles.scatter(*at.T, s=30, color=colour, edgecolors="black", linewidths=0.4, label=label, zorder=3)
    roles.legend()
    roles.set(title="Roles: cameras, and where they look")
    roles.set_aspect("equal", adjustable="datalim")
    groups.scatter(*look_in_world.T, s=12, color="lightgrey")
    for number, group in enumerate(members[:_GROUPS_DRAWN]):
        look = look_in_world[group]
        for member in look[1:]:
            groups.plot(*np.stack([look[0], member]).T, color=f"C{number}", lw=1, alpha=0.7)
        groups.scatter(*look[0], s=60, color=f"C{number}", edgecolors="black", zorder=3)
    drawn = min(len(members), _GROUPS_DRAWN)
    groups.set(title=f"{drawn} of {len(members)} groups: where centre and members look")
    groups.set_aspect("equal", adjustable="datalim")
    figure.savefig(path, dpi=100, metadata={"Software": None})
