"""The shape of the project: imports point one way, no packages import each other, each engine has its doors."""

from __future__ import annotations

import ast
import re
import subprocess
import sys
from collections.abc import Iterable, Iterator, Mapping
from functools import cache
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
LAYERS = ("aug3d_core", "tasks", "flows")
DOORS = {
    "pycolmap": {"aug3d_core/sfm", "aug3d_core/depth", "aug3d_core/poses/colmap.py"},
    "cv2": {"aug3d_core/depth", "aug3d_core/photos/redundant.py", "aug3d_core/look"},
    "open3d": {"aug3d_core/surface", "aug3d_core/geometry/raycast.py"},
    "bpy": {"aug3d_core/rendering"},
    "torch": {
        "aug3d_core/heads",
        "aug3d_core/dataset/warp.py",
        "aug3d_core/training",
        "aug3d_core/judging",
        "aug3d_core/novel",
        "aug3d_core/poses/torch_files.py",
        "aug3d_core/export/chunks.py",
        "aug3d_core/view/predictor.py",
        "aug3d_core/bench/gpu_job.py",
        "aug3d_core/domes/methods/sam_worker.py",
    },
    "rasterio": {"aug3d_core/export/maps.py", "aug3d_core/export/utm.py", "aug3d_core/photos/control.py"},
    "laspy": {"aug3d_core/export/points.py"},
    "trimesh": {"aug3d_core/export/glb.py"},
    "viser": {"aug3d_core/view"},
    "distributed": {"aug3d_core/factory/scheduler.py"},
    "obstore": {"aug3d_core/store/bucket.py"},
    "transformers": {"aug3d_core/domes/methods/sam_worker.py"},
    "prefect": {"tasks", "flows"},
    "mlflow": {"tasks"},
}


# The packages of aug3d_core from the bottom up: a package imports only from those before it. `run` executes stages, `store`
# keeps what they write, `factory` knows the list of them; what judges or shows runs stands above.
ORDER = (
    "run", "geometry",
    "photos", "poses", "sfm", "split", "groups", "depth", "surface", "overlap", "domes", "rendering", "dataset",
    "heads", "training", "judging", "novel", "town",
    "store", "factory", "metrics", "report", "look", "export", "view", "video", "advice", "scene_files", "collections",
    "studies", "bench",
)  # fmt: skip
STAGES = ORDER[ORDER.index("photos") : ORDER.index("store")]
# Besides `files.py`, which every later stage may read, stage packages import of one another only what is listed here.
SHARED = {
    "groups": ("split",),  # groups are made within a split
    "overlap": ("split", "groups"),  # measures groups of every way
    "heads": ("dataset",),  # a model sees packed scenes
    "training": ("dataset", "heads"),
    "judging": ("dataset", "heads"),
    "novel": ("dataset", "heads", "judging", "poses"),  # judged as in the test; poses from outside are read
    # Is rendered, holds what was found against its truth, and is packed
    "town": ("rendering", "domes", "groups", "overlap", "dataset"),
}
# Every package has a map of its modules but the root, whose map is in CONTRIBUTING.md
MAPPED = sorted((ROOT / "aug3d_core").glob("*/**/__init__.py"))
# What these hold is the same everywhere: a map may leave them out
OF_MANY_PACKAGES = {"__init__", "__main__", "config", "files", "declared", "decisions", "stage"}
# All that training, judging and novel views know of a model: settings by name, the protocol, a trained head on disk
PROTOCOL = {"aug3d_core.heads"} | {f"aug3d_core.heads.{module}" for module in ("config", "head", "saved")}


def sources() -> list[Path]:
    return sorted(path for layer in LAYERS for path in (ROOT / layer).rglob("*.py"))


@cache  # a dozen tests ask for all of them
def import_statements(source: Path) -> tuple[ast.Import | ast.ImportFrom, ...]:
    nodes = ast.walk(ast.parse(source.read_bytes()))
    return tuple(node for node in nodes if isinstance(node, ast.Import | ast.ImportFrom))


def imports(source: Path) -> Iterator[str]:
    for node in import_statements(source):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        else:
            yield "." * node.level + (node.module or "")


@pytest.mark.parametrize("source", sources(), ids=lambda path: str(path.relative_to(ROOT)))
def test_imports_point_from_flows_to_tasks_to_core(source: Path) -> None:
    layer = LAYERS.index(source.relative_to(ROOT).parts[0])
    for name in imports(source):
        assert not name.startswith("."), "imports are absolute"
        top = name.partition(".")[0]
        if top in LAYERS:
            assert LAYERS.index(top) <= layer, f"{source} imports {name}"


def modules() -> dict[str, Path]:
    """Return every module of aug3d_core by its dotted name."""
    found = {}
    for path in (ROOT / "aug3d_core").rglob("*.py"):
        parts = path.relative_to(ROOT).with_suffix("").parts
        found[".".join(parts[:-1] if parts[-1] == "__init__" else parts)] = path
    return found


def internal_imports(modules: Mapping[str, Path], module: str) -> set[str]:
    """Return the modules of aug3d_core that a module imports, in functions too."""
    found = set()
    for node in import_statements(modules[module]):
        if isinstance(node, ast.Import):
            found.update(alias.name for alias in node.names)
        elif node.module:
            inner = {f"{node.module}.{alias.name}" for alias in node.names}
            found.update(name if name in modules else node.module for name in inner)
    return {name for name in found if name.partition(".")[0] == "aug3d_core"}


def package(module: str) -> str:
    """Return the package of a module within aug3d_core; of a head its own, since heads never import each other."""
    parts = module.split(".")[1:]
    return ".".join(parts[:2]) if parts[:1] == ["heads"] and len(parts) > 2 else (parts or [""])[0]


def complaints(arrows: Iterable[tuple[str, str]]) -> Iterator[str]:
    """Yield what is wrong with imports, given as pairs of modules."""
    for module, imported in arrows:
        here, there = package(module), package(imported)
        top, other, leaf = here.partition(".")[0], there.partition(".")[0], imported.rpartition(".")[2]
        if here == there or top not in ORDER or other not in ORDER:
            continue
        if here.startswith("heads.") and there.startswith("heads."):
            yield f"{module} imports another head: {imported}"
        elif there.startswith("heads.") and top in STAGES and top != "heads":
            yield f"{module} imports a head: {imported}"
        elif top in ("training", "judging", "novel") and there == "heads" and imported not in PROTOCOL:
            yield f"{module} imports {imported}, not the protocol"
        elif ORDER.index(other) > ORDER.index(top):
            yield f"{module} imports upwards: {imported}"
        elif top in STAGES and other in STAGES and other not in (top, *SHARED.get(top, ())) and leaf != "files":
            yield f"{module} imports more of {other} than its files.py: {imported}"


def circles(arrows: Iterable[tuple[str, str]]) -> set[str]:
    """Return the packages that import themselves through others."""
    reach: dict[str, set[str]] = {}
    for module, imported in arrows:
        if package(module) != package(imported):
            reach.setdefault(package(module), set()).add(package(imported))
    grown = True
    while grown:
        grown = False
        for direct in reach.values():
            further = set().union(*(reach.get(name, set()) for name in direct))
            grown |= not further <= direct
            direct |= further
    return {name for name, all_reached in reach.items() if name in all_reached}


def all_arrows() -> list[tuple[str, str]]:
    known = modules()
    return [(module, imported) for module in known for imported in internal_imports(known, module)]


def test_packages_import_downwards_and_stages_through_files() -> None:
    assert not list(complaints(all_arrows()))


def test_no_packages_import_each_other() -> None:
    assert not circles(all_arrows())


def test_every_package_has_its_place() -> None:
    assert {package(module).partition(".")[0] for module in modules()} - {"", "doctor", "__main__"} == set(ORDER)


@pytest.mark.parametrize("init", MAPPED, ids=lambda path: path.parent.relative_to(ROOT / "aug3d_core").as_posix())
def test_the_map_of_a_package_names_its_modules(init: Path) -> None:
    """A map is in the docstring of the package; each of its lines is `name   what it does` or `name, name   what they do`."""
    lines = re.findall(r"^(\w+(?:, \w+)*) {2,}\S", ast.get_docstring(ast.parse(init.read_bytes())) or "", re.MULTILINE)
    named = {name for line in lines for name in line.split(", ")}
    packages = {path.parent.name for path in init.parent.glob("*/__init__.py")}
    known = {path.stem for path in init.parent.glob("*.py")} | packages
    assert known - OF_MANY_PACKAGES - named == set(), "these modules are not in it"
    assert named - known == set(), "these are no modules"


def test_contributing_lists_all_packages() -> None:
    rows = re.findall(r"^\| (`[^|]+) \|", (ROOT / "CONTRIBUTING.md").read_text(), re.MULTILINE)
    assert sorted(re.findall(r"`(\w+)`", " ".join(rows))) == sorted(ORDER)


WRONG = {
    "aug3d_core.run.stage -> aug3d_core.store.store": "upwards",
    "aug3d_core.store.store -> aug3d_core.factory.build": "upwards",
    "aug3d_core.sfm.stage -> aug3d_core.photos.decode": "files.py",
    "aug3d_core.training.loop -> aug3d_core.heads.pixelnerf.model": "imports a head",
    "aug3d_core.judging.scores -> aug3d_core.heads.exposure": "not the protocol",
    "aug3d_core.heads.pixelnerf.model -> aug3d_core.heads.sweep.model": "another head",
}


@pytest.mark.parametrize("arrow", WRONG)
def test_a_wrong_arrow_is_found(arrow: str) -> None:
    module, _, imported = arrow.partition(" -> ")
    assert [WRONG[arrow] in complaint for complaint in complaints([(module, imported)])] == [True]


def test_a_circle_is_found() -> None:
    chain = [("aug3d_core.sfm.stage", "aug3d_core.depth.stage"), ("aug3d_core.depth.sweep", "aug3d_core.surface.build")]
    assert not circles(chain)
    assert circles([*chain, ("aug3d_core.surface.stage", "aug3d_core.sfm.align")]) == {"sfm", "depth", "surface"}


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
    heavy = {"prefect", "mlflow", "pycolmap", "open3d", "bpy", "torch", "cv2", "zarr", "scipy", "matplotlib", "viser"}
    light = "aug3d_core.factory.stages, aug3d_core.factory.config, aug3d_core.factory.build, flows.cli"
    code = f"import sys, {light}; print(*sys.modules)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, cwd=ROOT)
    assert not heavy & set(done.stdout.split())


@pytest.mark.parametrize("first", ["groups.scene", "groups.methods", "domes.site", "domes.methods"])
def test_packages_with_a_table_can_be_entered_anywhere(first: str) -> None:
    """A table of methods in `__init__.py` imports every method, which must not import the table again."""
    subprocess.run([sys.executable, "-c", f"import aug3d_core.{first}"], check=True, cwd=ROOT)
