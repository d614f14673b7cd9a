"""`.pt` files -> plain values, without executing code in them."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import torch

from aug3d_core.run.errors import InputError
from aug3d_core.run.regular_file import opened
from aug3d_core.run.stored_archive import check_stored

_MOST_NUMBERS = 1000  # of one value; a pose has 12, a camera 4


def read_pt(file: Path) -> dict[str, Any]:
    """Return the dictionary of a file, tensors as numpy arrays; raises InputError that names the file.

    A `.pt` file is a pickle, which could run any program. torch's unpickler for weights builds only tensors and plain
    containers, and refuses everything else before calling it. A tensor may claim more than its file holds: it is not
    written out.
    """
    try:
        with opened(file) as handle:
            check_stored(handle)
            content = torch.load(handle, map_location="cpu", weights_only=True)
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
    return {key: _plain(value, f"{file}: {key}") for key, value in content.items()}


def _plain(value: Any, where: str) -> Any:
    """Return a tensor as an array; raises InputError for one that is not a dense block of numbers of a pose file's size."""
    if not isinstance(value, torch.Tensor):
        return value
    if value.layout is not torch.strided or value.is_quantized or value.is_complex() or value.device.type != "cpu":
        raise InputError(f"{where} is no dense tensor", "Use files written by Mega-NeRF.")
    if value.numel() > _MOST_NUMBERS:
        raise InputError(
            f"{where} holds {value.numel()} numbers, more than {_MOST_NUMBERS}", "Use files written by Mega-NeRF."
        )
    return value.detach().resolve_conj().resolve_neg().to(torch.float64).numpy()
