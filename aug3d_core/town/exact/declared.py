"""What the factory knows of towns that are packed from their truth."""

from __future__ import annotations

from aug3d_core.run.metric import declared
from aug3d_core.run.stage import Stage
from aug3d_core.town.exact.config import ExactTownConfig

EXACT_TOWN = Stage(
    name="exact_town",
    description="A made-up town as a data set, packed straight from its truth.",
    config=ExactTownConfig,
    inputs=(),
    entry="aug3d_core.town.exact.stage:run",
    engines=("bpy", "pillow", "scipy", "zarr"),
    accuracy="views",
    metrics=declared(lower="seconds_per_view", neither="views groups_rendered buildings slab_thickness"),
)
