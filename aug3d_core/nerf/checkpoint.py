"""Weights and training state on disk. Nothing is read in a way that could run code."""

from __future__ import annotations

import json
import pickle
from pathlib import Path
from typing import Any

import torch
from pydantic import ValidationError
from safetensors import SafetensorError
from safetensors.torch import load_file, save_file

from aug3d_core.errors import InputError
from aug3d_core.nerf.config import TrainingConfig
from aug3d_core.nerf.model import PixelNeRF
from aug3d_core.store import layout

STATE = "state.pt"
AGAIN = "train the model again (stage training)"


def save_model(model: PixelNeRF, out: Path) -> None:
    """Write the weights, and the configuration that says which network they belong to."""
    save_file({name: value.contiguous() for name, value in model.state_dict().items()}, out / layout.MODEL_WEIGHTS)
    text = json.dumps({"config": model.config.model_dump(mode="json")}, indent=1, sort_keys=True)
    (out / layout.MODEL_CONFIG).write_text(text + "\n")


def load_model(folder: Path) -> PixelNeRF:
    """Read a trained model, ready for use."""
    try:
        config = TrainingConfig(**json.loads((folder / layout.MODEL_CONFIG).read_text())["config"])
        model = PixelNeRF(config)
        model.load_state_dict(load_file(folder / layout.MODEL_WEIGHTS))
    except FileNotFoundError as error:
        raise InputError(f"the model has no {Path(error.filename or layout.MODEL_WEIGHTS).name}", AGAIN) from error
    except (SafetensorError, ValueError, KeyError, TypeError, ValidationError) as error:
        raise InputError(f"{layout.MODEL_WEIGHTS} or {layout.MODEL_CONFIG} is damaged ({error})", AGAIN) from error
    except RuntimeError as error:
        missing = " ".join(str(error).splitlines()[1:2]).strip()[:200]
        raise InputError(f"{layout.MODEL_WEIGHTS} belongs to another network: {missing}", AGAIN) from error
    return model.eval()


def save_state(folder: Path, state: dict[str, Any]) -> None:
    """Write the training state; a kill in between leaves the former one."""
    folder.mkdir(exist_ok=True)
    partial = folder / f"{STATE}.partial"
    torch.save(state, partial)
    partial.replace(folder / STATE)


def load_state(folder: Path) -> dict[str, Any] | None:
    """Read the training state that a killed run left, if it did."""
    path = folder / STATE
    if not path.exists():
        return None
    try:
        return torch.load(path, weights_only=True)
    except (RuntimeError, EOFError, OSError, KeyError, ValueError, pickle.UnpicklingError) as error:
        reason = str(error).partition("\n")[0] or type(error).__name__
        raise InputError(
            f"checkpoint {path.name} is damaged ({reason})", f"delete {path} to train from the start"
        ) from error
