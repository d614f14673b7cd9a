"""First weights of the sweep: those that aug3d ships, or those of a file."""

from __future__ import annotations

from pathlib import Path

from safetensors import SafetensorError
from safetensors.torch import load_file
from torch import Tensor, nn

from aug3d_core.heads.files import MODEL_WEIGHTS
from aug3d_core.heads.sweep.config import SHIPPED, SHIPPED_DIGEST, TOWNS
from aug3d_core.run.digest import file_digest
from aug3d_core.run.errors import InputError
from aug3d_core.run.regular_file import opened

_OTHERWISE = "set training.head.start=random, or name the model.safetensors of a sweep with the same settings"


def first_weights(head: nn.Module, start: str) -> dict[str, Tensor]:
    """Return the weights that are named, as a state of the head; raises InputError that names what is wrong with them."""
    file = SHIPPED / MODEL_WEIGHTS if start == TOWNS else Path(start).expanduser()
    weights = _read(file)
    if start == TOWNS and file_digest(file) != SHIPPED_DIGEST:
        raise InputError(f"{file} is not what aug3d ships", "install aug3d again, or set training.head.start=random")
    return _fitting(head, file, weights)


def _read(file: Path) -> dict[str, Tensor]:
    try:
        opened(file).close()
        return load_file(file)
    except FileNotFoundError as error:
        raise InputError(f"training.head.start: there is no file {file}", _OTHERWISE) from error
    except (SafetensorError, OSError, ValueError) as error:
        raise InputError(
            f"training.head.start: {file} is damaged, or no safetensors file ({error})", _OTHERWISE
        ) from error


def _fitting(head: nn.Module, file: Path, weights: dict[str, Tensor]) -> dict[str, Tensor]:
    own = {name: tuple(value.shape) for name, value in head.state_dict().items()}
    if missing := sorted(own.keys() - weights.keys()):
        raise InputError(f"training.head.start: {file} is of another head: it has no {missing[0]}", _OTHERWISE)
    if other := sorted(name for name in own if tuple(weights[name].shape) != own[name]):
        found, wanted = (" x ".join(map(str, shape)) for shape in (weights[other[0]].shape, own[other[0]]))
        raise InputError(
            f"training.head.start: {file} is of other settings: {other[0]} is {found}, here {wanted}"
            " (training.head.features must be the same)",
            _OTHERWISE,
        )
    return {name: weights[name] for name in own}
