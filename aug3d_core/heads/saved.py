"""A trained head on disk: weights as safetensors, and the configuration that says which network they belong to."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import torch
from pydantic import ValidationError
from safetensors import SafetensorError
from safetensors.torch import load_file, save_file

from aug3d_core.heads.config import FIRST, HeadConfig, config_of
from aug3d_core.heads.files import MODEL_CONFIG, MODEL_WEIGHTS
from aug3d_core.heads.head import Head, build
from aug3d_core.run.errors import InputError
from aug3d_core.run.regular_file import json_content, opened

AGAIN = "train the model again (stage training)"


def save(head: Head, out: Path) -> None:
    """Write the weights and the configuration."""
    save_file({name: value.cpu().contiguous() for name, value in head.state_dict().items()}, out / MODEL_WEIGHTS)
    text = json.dumps({"head": head.config.model_dump(mode="json")}, indent=1, sort_keys=True)
    (out / MODEL_CONFIG).write_text(text + "\n")


def load(folder: Path) -> Head:
    """Read a trained head, ready for use, on a GPU if there is one."""
    try:
        head = build(_config(json_content(folder / MODEL_CONFIG)))
        opened(folder / MODEL_WEIGHTS).close()
        head.load_state_dict(load_file(folder / MODEL_WEIGHTS))
    except FileNotFoundError as error:
        raise InputError(f"the model has no {Path(error.filename or MODEL_WEIGHTS).name}", AGAIN) from error
    except (SafetensorError, OSError, ValueError, KeyError, TypeError, AttributeError, ValidationError) as error:
        raise InputError(f"{MODEL_WEIGHTS} or {MODEL_CONFIG} is damaged ({error})", AGAIN) from error
    except RuntimeError as error:
        missing = " ".join(str(error).splitlines()[1:2]).strip()[:200]
        raise InputError(f"{MODEL_WEIGHTS} belongs to another network: {missing}", AGAIN) from error
    return head.eval().to("cuda" if torch.cuda.is_available() else "cpu")


def _config(told: dict[str, Any]) -> HeadConfig:
    """Return the settings of a saved head; up to 0.6 they stood among those of training, and the head had no name."""
    if "head" in told:
        kind, values = config_of(told["head"]["name"]), told["head"]
    else:
        kind = config_of(FIRST)
        values = {"name": FIRST} | {name: told["config"][name] for name in kind.model_fields if name in told["config"]}
    needed = kind.model_fields.keys() - {*kind.of_training}  # a default could be another network
    if untold := sorted(needed - values.keys()):
        raise InputError(f"the model was trained before there was {', '.join(untold)}", AGAIN)
    return kind.model_validate(values)
