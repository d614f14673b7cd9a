"""The key of a piece of work: a hash of everything that can change its result.

key = sha256(stage name, digest of the stage's code, configuration, input digests, engine versions). The seed is a field of
the configuration. The code digest follows the imports of the stage function through `aug3d_core`, so that a change in
`geometry/` reaches every stage that uses it, and a change in `nerf/` does not reach SfM.
"""

from __future__ import annotations

import ast
import hashlib
import importlib.util
import json
import sys
from collections.abc import Iterable, Mapping
from contextlib import suppress
from functools import lru_cache
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

from aug3d_core.stage import Stage, StageConfig

_digests: dict[str, tuple[dict[Path, int], str]] = {}  # module -> its files' times, digest of them
_GPU_BUILDS = {"pycolmap": ("pycolmap-cuda12",)}
_NONE = "none"  # the version of what is not installed


def object_key(stage: Stage, config: StageConfig, input_digests: Mapping[str, str]) -> str:
    """Return the key of the object that `stage` makes from these inputs."""
    return _hashed({"recipe": recipe(stage, config), "inputs": dict(input_digests)})


def recipe(stage: Stage, config: StageConfig) -> str:
    """Return the part of the key that does not depend on the inputs: stage, code, configuration, engines."""
    return _hashed(
        {
            "stage": stage.name,
            "code": code_digest(stage.entry.partition(":")[0]),
            "config": config.model_dump(mode="json"),
            "engines": engine_versions(stage, config),
            **({"afresh": True} if stage.afresh else {}),
            **({"files": read} if (read := _read(config)) else {}),
        }
    )


def _read(config: StageConfig) -> dict[str, str]:
    """Return the digest of each file that the settings name, "none" if it is not there: the stage says so."""
    return {
        str(file): _file_digest(file, file.stat().st_mtime_ns) if file.is_file() else "none" for file in config.files
    }


@lru_cache
def _file_digest(file: Path, _changed_at_ns: int) -> str:
    with file.open("rb") as content:
        return hashlib.file_digest(content, "sha256").hexdigest()


def _hashed(parts: dict[str, object]) -> str:
    return hashlib.sha256(json.dumps(parts, sort_keys=True).encode()).hexdigest()[:32]


def engine_versions(stage: Stage, config: StageConfig) -> dict[str, str]:
    """Return the installed version of each engine that the stage runs on, "none" if it is not there.

    numpy is one of every stage's. A build for GPUs may come as a distribution of its own; it counts as another engine, since
    it may do other work.
    """
    return {build: _version(build) for build in map(_installed_build, ("numpy", *stage.engines, *config.engines))}


def _version(build: str) -> str:
    # Whoever installs or removes a distribution writes to a folder of the path
    return _version_told(build, tuple(_changed_at(map(Path, sys.path)).values()))


@lru_cache
def _version_told(build: str, _changed_at_ns: tuple[int, ...]) -> str:
    try:
        return version(build)
    except PackageNotFoundError:
        return _NONE  # the stage says what is to be installed


def _installed_build(engine: str) -> str:
    """Return the distribution that provides an engine: its GPU build where that is installed."""
    return next((build for build in _GPU_BUILDS.get(engine, ()) if _version(build) != _NONE), engine)


def code_digest(module: str) -> str:
    """Hash a module and every `aug3d_core` module it imports, at any depth. Comments, docstrings and layout do not count.

    It is of the code as it is now: a file that changed since the last time is read again.
    """
    times, digest = _digests.get(module, ({}, ""))
    if _source_path(module) not in times or times != _changed_at(times):
        files = {name: _source_path(name) for name in sorted(_import_closure(module))}
        times = _changed_at(files.values())
        sources = {name: _syntax(file) for name, file in files.items()}
        digest = hashlib.sha256(json.dumps(sources, sort_keys=True).encode()).hexdigest()
        _digests[module] = times, digest
    return digest


def _changed_at(files: Iterable[Path]) -> dict[Path, int]:
    """Return when each of the files and folders that are there was last written, ns."""
    times = {}
    for file in files:
        with suppress(OSError):
            times[file] = file.stat().st_mtime_ns
    return times


def _import_closure(module: str) -> set[str]:
    seen: set[str] = set()
    queue = [module]
    while queue:
        name = queue.pop()
        if name not in seen:
            seen.add(name)
            queue.extend(imported_modules(_source_path(name)))
    return seen


def imported_modules(source: Path) -> set[str]:
    """Return the `aug3d_core` modules that a source file imports, inside functions too."""
    found: set[str] = set()
    for node in ast.walk(ast.parse(source.read_bytes())):
        if isinstance(node, ast.Import):
            found.update(alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and node.module and node.level == 0:
            found.add(node.module)
            found.update(f"{node.module}.{alias.name}" for alias in node.names)
        elif isinstance(node, ast.Constant) and isinstance(node.value, str):
            # `[sys.executable, "-m", "aug3d_core.rendering.worker"]`: a worker process is code of the stage too
            found.add(node.value.partition(":")[0])
    return {name for name in found if name.startswith("aug3d_core") and _exists(name)}


@lru_cache
def _exists(module: str) -> bool:
    return all(part.isidentifier() for part in module.split(".")) and _source_path(module).is_file()


def _source_path(module: str) -> Path:
    # Only the top package is looked up: looking up a submodule would import its parents, engines and all.
    top, *parts = module.split(".")
    spec = importlib.util.find_spec(top)
    if spec is None or not spec.submodule_search_locations:
        raise ModuleNotFoundError(module)
    path = Path(spec.submodule_search_locations[0]).joinpath(*parts)
    return path / "__init__.py" if path.is_dir() else path.with_suffix(".py")


def _syntax(source: Path) -> str:
    tree = ast.parse(source.read_bytes())
    for node in ast.walk(tree):
        if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef) and ast.get_docstring(node) is not None:
            node.body = node.body[1:]
    return ast.dump(tree)
