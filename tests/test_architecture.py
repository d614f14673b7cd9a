"""The shape of the project: imports point one way, each engine has one door, importing is cheap."""

from __future__ import annotations

import ast
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
LAYERS = ("aug3d_core", "tasks", "flows")
DOORS = {
    "pycolmap": {"aug3d_core/sfm", "aug3d_core/depth", "aug3d_core/formats/colmap.py"},
    "cv2": {"aug3d_core/depth", "aug3d_core/photos/redundant.py"},
    "open3d": {"aug3d_core/surface"},
    "bpy": {"aug3d_core/rendering"},
    "torch": {"aug3d_core/nerf", "aug3d_core/formats/torch_files.py", "aug3d_core/sampling/sam_worker.py"},
    "transformers": {"aug3d_core/sampling/sam_worker.py"},
    "prefect": {"tasks", "flows"},
    "mlflow": {"tasks"},
}


def sources() -> list[Path]:
    return sorted(path for layer in LAYERS for path in (ROOT / layer).rglob("*.py"))


def imports(source: Path) -> Iterator[str]:
    for node in ast.walk(ast.parse(source.read_bytes())):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            yield "." * node.level + (node.module or "")


@pytest.mark.parametrize("source", sources(), ids=lambda path: str(path.relative_to(ROOT)))
def test_imports_point_from_flows_to_tasks_to_core(source: Path) -> None:
    layer = LAYERS.index(source.relative_to(ROOT).parts[0])
    for name in imports(source):
        assert not name.startswith("."), "imports are absolute"
        top = name.partition(".")[0]
        if top in LAYERS:
            assert LAYERS.index(top) <= layer, f"{source} imports {name}"


@pytest.mark.parametrize("engine", DOORS)
def test_each_engine_has_its_doors(engine: str) -> None:
    for source in sources():
        place = source.relative_to(ROOT).as_posix()
        if any(name.partition(".")[0] == engine for name in imports(source)):
            assert any(place.startswith(door) for door in DOORS[engine]), f"{place} imports {engine}"


def test_no_module_imports_two_native_engines() -> None:
    engines = {"pycolmap", "open3d", "bpy", "torch", "cv2"}
    for source in sources():
        assert len({name.partition(".")[0] for name in imports(source)} & engines) <= 1, source


def test_nothing_heavy_is_loaded_to_describe_and_start_the_stages() -> None:
    heavy = {"prefect", "mlflow", "pycolmap", "open3d", "bpy", "torch", "cv2", "zarr", "scipy", "matplotlib"}
    code = "import sys, aug3d_core.stages, aug3d_core.scene_config, aug3d_core.make, flows.cli; print(*sys.modules)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, cwd=ROOT)
    assert not heavy & set(done.stdout.split())
