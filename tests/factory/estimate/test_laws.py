"""The laws know the stages' own bounds: a run is refused at once by what its stages will really take."""

from __future__ import annotations

import ast
from pathlib import Path

import pytest

from aug3d_core.factory.estimate import laws

CORE = Path(laws.__file__).parents[2]


def stated(module: str, name: str) -> float:
    """Return a number that a module of a stage states; read, not imported: the stages' engines do not share a process."""
    for node in ast.parse((CORE / module).read_text()).body:
        match node:
            case ast.Assign(targets=[ast.Name(id=found)], value=value) if found == name:
                return ast.literal_eval(value)
    raise AssertionError(f"{module} states no {name}: see what took its place, and what the laws say of it")


@pytest.mark.parametrize(
    ("copied", "module", "name"),
    [
        (laws._CACHE_SHARE, "depth/fusion.py", "CACHE_SHARE"),
        (laws._FUSED_MPX * laws.MEGA, "depth/fusion_tiles.py", "MOST_PIXELS"),
        (laws._ALL_RANKED - 1, "sfm/pairs.py", "_FEW"),
        (laws._TILES_SHARE, "surface/draw.py", "MEMORY_SHARE"),
    ],
)
def test_a_bound_of_a_stage_is_the_laws_too(copied: float, module: str, name: str) -> None:
    assert copied == stated(module, name)


def test_a_tile_of_the_surface_is_as_large_as_its_stage_makes_it() -> None:
    most, point_bytes = stated("surface/tiles.py", "MOST_POINTS"), stated("surface/draw.py", "POINT_BYTES")
    assert pytest.approx(most, rel=0.01) == 79_000 * laws._TILED_MPX, "fused points of a megapixel of depth maps"
    assert pytest.approx(most * point_bytes / 2**20, rel=0.01) == laws._TILE_MIB
