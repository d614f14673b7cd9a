"""The key of a piece of work: a hash of everything that can change its result.

recipe = sha256(stage name, code that the stage reaches, configuration, engine versions); key = sha256(recipe, input digests).
The seed is a field of the configuration. `code.py` says what counts as code.
"""

from __future__ import annotations

import hashlib
import json
import sys
from collections.abc import Iterable, Mapping
from functools import lru_cache
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

from aug3d_core.run.digest import file_digest
from aug3d_core.run.stage import Stage, StageConfig
from aug3d_core.store.code import changed_at, code_digest

_GPU_BUILDS = {"pycolmap": ("pycolmap-cuda12",)}
_NONE = "none"  # the version of what is not installed


def object_key(recipe: str, input_digests: Mapping[str, str]) -> str:
    """Return the key of the object that a recipe makes from these inputs."""
    return _hashed({"recipe": recipe, "inputs": dict(input_digests)})


def recipe_of(stage: Stage, config: StageConfig, also: Iterable[str] = ()) -> str:
    """Return the part of the key that does not depend on the inputs: stage, code, configuration, engines.

    also: code that the stage runs because of what made its inputs.
    """
    return _hashed(
        {
            "stage": stage.name,
            "code": code_digest((stage.entry, *config.modules, *also)),
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
    return file_digest(file)


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
    return _version_told(build, tuple(changed_at(map(Path, sys.path)).values()))


@lru_cache
def _version_told(build: str, _changed_at_ns: tuple[int, ...]) -> str:
    try:
        return version(build)
    except PackageNotFoundError:
        return _NONE  # the stage says what is to be installed


def _installed_build(engine: str) -> str:
    """Return the distribution that provides an engine: its GPU build where that is installed."""
    return next((build for build in _GPU_BUILDS.get(engine, ()) if _version(build) != _NONE), engine)
