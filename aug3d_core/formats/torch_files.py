"""`.pt` files -> plain values, without running code in them. The only door to torch besides `nerf`."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import torch

from aug3d_core.errors import InputError


def read_pt(file: Path) -> dict[str, Any]:
    """Return the dictionary of a file, tensors as numpy arrays; raises InputError that names the file.

    A `.pt` file is a pickle, which could run any program; torch's own unpickler for weights builds tensors and plain
    containers only, and refuses everything else before anything of it is called.
    """
    try:
        content = torch.load(file, map_location="cpu", weights_only=True)
    except Exception as error:  # the unpickler raises whatever damaged bytes make it meet
        reason = str(error).splitlines()[0] if str(error) else type(error).__name__
        raise InputError(
            f"{file} cannot be read as plain tensors: {reason}",
            "Copy it again; if it is intact it holds more than tensors, which is not opened.",
        ) from error
    if not isinstance(content, dict):
        raise InputError(f"{file} holds a {type(content).__name__}, not a dictionary", "Give Mega-NeRF's own files.")
    return {key: value.numpy() if isinstance(value, torch.Tensor) else value for key, value in content.items()}
