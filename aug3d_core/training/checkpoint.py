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

from aug3d_core.heads.pixelnerf.config import TrainingConfig
from aug3d_core.heads.pixelnerf.model import PixelNeRF
from aug3d_core.run.atomic_file import replacing
from aug3d_core.run.errors import InputError
from aug3d_core.training.divergence import WINDOW
from aug3d_core.training.files import MODEL_CONFIG, MODEL_WEIGHTS

STATE = "state-{:08d}.pt"
KEPT = 4  # windows: trouble is seen up to two after it began, and a second restart goes further back
AGAIN = "train the model again (stage training)"


def save_model(model: PixelNeRF, out: Path) -> None:
    """Write the weights, and the configuration that says which network they belong to."""
    save_file({name: value.cpu().contiguous() for name, value in model.state_dict().items()}, out / MODEL_WEIGHTS)
    text = json.dumps({"config": model.config.model_dump(mode="json")}, indent=1, sort_keys=True)
    (out / MODEL_CONFIG).write_text(text + "\n")


def load_model(folder: Path) -> PixelNeRF:
    """Read a trained model, ready for use, on a GPU if there is one."""
    try:
        told = json.loads((folder / MODEL_CONFIG).read_text())["config"]
        if untold := sorted(TrainingConfig.model_fields.keys() - told.keys()):  # a default could be another network
            raise InputError(f"the model was trained before there was {', '.join(untold)}", AGAIN)
        config = TrainingConfig(**told)
        model = PixelNeRF(config)
        model.load_state_dict(load_file(folder / MODEL_WEIGHTS))
    except FileNotFoundError as error:
        raise InputError(f"the model has no {Path(error.filename or MODEL_WEIGHTS).name}", AGAIN) from error
    except (SafetensorError, ValueError, KeyError, TypeError, AttributeError, ValidationError) as error:
        raise InputError(f"{MODEL_WEIGHTS} or {MODEL_CONFIG} is damaged ({error})", AGAIN) from error
    except RuntimeError as error:
        missing = " ".join(str(error).splitlines()[1:2]).strip()[:200]
        raise InputError(f"{MODEL_WEIGHTS} belongs to another network: {missing}", AGAIN) from error
    return model.eval().to("cuda" if torch.cuda.is_available() else "cpu")


def save_state(folder: Path, step: int, state: dict[str, Any]) -> None:
    """Write the training state after a step; a kill or a power cut in between leaves the former ones."""
    folder.mkdir(exist_ok=True)
    path = folder / STATE.format(step)
    with replacing(path, path.with_suffix(".partial")) as file:
        torch.save(state, file)
    for old in _superfluous(saved_steps(folder)):
        (folder / STATE.format(old)).unlink()


def saved_steps(folder: Path) -> list[int]:
    """Return the steps of the states there are, in order."""
    return sorted(int(path.stem.partition("-")[2]) for path in folder.glob(STATE.replace("{:08d}", "*")))


def load_state(folder: Path, step: int) -> dict[str, Any]:
    """Read a training state; raises InputError if it is damaged."""
    path = folder / STATE.format(step)
    try:
        return torch.load(path, map_location="cpu", weights_only=True)
    except (RuntimeError, EOFError, OSError, KeyError, ValueError, pickle.UnpicklingError) as error:
        reason = str(error).partition("\n")[0] or type(error).__name__
        raise InputError(
            f"checkpoint {path.name} is damaged ({reason})", f"delete {path}: training goes on from an older one"
        ) from error


def forget_after(folder: Path, step: int) -> None:
    """Remove the states after a step."""
    for later in saved_steps(folder):
        if later > step:
            (folder / STATE.format(later)).unlink()


def _superfluous(steps: list[int]) -> list[int]:
    """Return what nobody will go back to: all but the newest, and the first in each of the last few windows."""
    firsts = {step // WINDOW: step for step in reversed(steps)}
    kept = {*steps[-1:], *sorted(firsts.values())[-KEPT:]}
    return [step for step in steps if step not in kept]
