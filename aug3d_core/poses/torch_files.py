"""`.pt` files -> plain values, without executing code in them."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import torch

from aug3d_core.run.errors import InputError


def read_pt(file: Path) -> dict[str, Any]:
    """Return the dictionary of a file, tensors as numpy arrays; raises InputError that names the file.

    A `.pt` file is a pickle, which could run any program. torch's unpickler for weights builds only tensors and plain
    containers, and refuses everything else before calling it.
    """
    try:
        content = torch.load(file, map_location="cpu", weights_only=True)
    except Exception as error:  # damaged bytes can make the unpickler raise anything
        reason = str(error).splitlines()[0] if str(error) else type(error).__name__
        raise InputError(
            f"{file} cannot be read as plain tensors: {reason}",
            "Copy it again. If it is intact, it holds more than tensors and is not opened.",
        ) from error
    if not isinstance(content, dict):
        raise InputError(
            f"{file} holds a {type(content).__name__}, not a dictionary", "Use files written by Mega-NeRF."
        )
    return {key: value.numpy() if isinstance(value, torch.Tensor) else value for key, value in content.items()}
