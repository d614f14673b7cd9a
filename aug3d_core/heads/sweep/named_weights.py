"""A look, before a run, at the file of first weights that its settings name: at its header alone, and without torch."""

from __future__ import annotations

from pathlib import Path

from safetensors import SafetensorError, safe_open

from aug3d_core.heads.files import MODEL_WEIGHTS
from aug3d_core.heads.sweep.config import SHIPPED, SweepConfig
from aug3d_core.run.errors import InputError
from aug3d_core.run.regular_file import opened

_WIDTH = "network.coarse_features.bias"  # has as many values as the head has features
_OTHERWISE = "name the model.safetensors of a sweep with the same settings, or set training.head.start=random"


def check_named(config: SweepConfig) -> None:
    """Raise InputError that names the file of the first weights and what is wrong with it, as training would."""
    for file in config.files:
        if why := _fault(file, config.features):
            raise InputError(f"training.head.start: {why}", _OTHERWISE)


def _fault(file: Path, features: int) -> str:
    try:
        found = _shapes(file)
    except FileNotFoundError:
        return f"there is no file {file}"
    except (SafetensorError, OSError, ValueError) as error:
        return f"{file} is damaged, or no safetensors file ({error})"
    if missing := sorted(_shapes(SHIPPED / MODEL_WEIGHTS).keys() - found.keys()):
        return f"{file} is of another head: it has no {missing[0]}"
    if found[_WIDTH] != [features]:
        return f"{file} is of other settings: of {found[_WIDTH][0]} features, here {features}"
    return ""


def _shapes(file: Path) -> dict[str, list[int]]:
    opened(file).close()
    with safe_open(file, "numpy") as weights:
        return {name: list(weights.get_slice(name).get_shape()) for name in weights.keys()}  # noqa: SIM118 (no mapping)
