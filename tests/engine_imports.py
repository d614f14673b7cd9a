"""Which native engines a test file loads into its process, read from the sources without running them."""

from __future__ import annotations

import ast
from collections.abc import Iterable, Iterator
from functools import cache
from itertools import combinations
from pathlib import Path

ROOT = Path(__file__).parents[1]
ENGINES = ("bpy", "cv2", "open3d", "pycolmap", "torch")
# Libraries of these corrupt each other's memory in one process. Blender is kept from all others.
_APART = [{"pycolmap", "cv2"}, {"pycolmap", "torch"}, {"open3d", "torch"}, *({"bpy", name} for name in ENGINES[1:])]
_OURS = ("aug3d_core", "tasks", "flows", "tests")


def mixed(loaded: Iterable[str]) -> set[str]:
    """Return the pairs that must not share a process, as `one and other`, among the modules that one has loaded."""
    engines = sorted(set(ENGINES) & set(loaded))
    return {" and ".join(pair) for pair in combinations(engines, 2) if set(pair) in _APART}


def engines_of(file: Path) -> frozenset[str]:
    """Return the engines that importing a test file loads, and those that its own functions import.

    Functions of other files are left alone: some are run in other processes.
    """
    seen: set[Path] = set()
    names: set[str] = set()
    waiting = {file}
    while waiting:
        source = waiting.pop()
        seen.add(source)
        imported = _imports(source)
        names |= imported
        waiting |= {found for name in imported for found in _files(name)} - seen
    return frozenset(names & set(ENGINES))


@cache
def _imports(source: Path) -> frozenset[str]:
    """Return the modules that are imported, and what is taken out of them, which may be a module too."""
    found: set[str] = set()
    for node in _statements(ast.parse(source.read_bytes()), into_functions=source.name.startswith("test_")):
        if isinstance(node, ast.Import):
            found.update(alias.name for alias in node.names)
        elif node.module:
            found.update({node.module, *(f"{node.module}.{alias.name}" for alias in node.names)})
    return frozenset(part for name in found for part in _with_parents(name))


def _statements(node: ast.AST, into_functions: bool) -> Iterator[ast.Import | ast.ImportFrom]:
    for child in ast.iter_child_nodes(node):
        if isinstance(child, ast.Import | ast.ImportFrom):
            yield child
        elif isinstance(child, ast.If) and ast.unparse(child.test) == "TYPE_CHECKING":
            continue
        elif into_functions or not isinstance(child, ast.FunctionDef | ast.AsyncFunctionDef):
            yield from _statements(child, into_functions)


def _with_parents(name: str) -> Iterator[str]:
    parts = name.split(".")
    return (".".join(parts[:end]) for end in range(1, len(parts) + 1))


@cache
def _files(name: str) -> tuple[Path, ...]:
    """Return the file of a module of the project; none for others."""
    if name.partition(".")[0] not in _OURS:
        return ()
    place = ROOT.joinpath(*name.split("."))
    return tuple(file for file in (place.with_suffix(".py"), place / "__init__.py") if file.is_file())
