"""What the paper's encoder starts from: ImageNet's weights if they are at hand, a file of weights, or chance."""

from __future__ import annotations

import pickle
import socket
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any
from urllib.error import URLError

import torch
from safetensors import SafetensorError
from safetensors.torch import load_file
from torch import Tensor

from aug3d_core.heads.pixelnerf.config import AUTO, RANDOM
from aug3d_core.heads.pixelnerf.named_weights import CHOICES, check_readable
from aug3d_core.heads.pixelnerf.resnet import ResNet34, used_weights
from aug3d_core.run.errors import InputError
from aug3d_core.run.regular_file import opened
from aug3d_core.run.stored_archive import check_stored

_IMAGENET = "https://download.pytorch.org/models/resnet34-b627a593.pth"  # torchvision's; the name ends in its SHA-256
_PATIENCE_S = 20.0


def start_trunk(trunk: ResNet34, setting: str) -> str:
    """Give the trunk the weights that the setting names; return where they came from, in words.

    `auto` looks into torch's cache of downloads, then tries to download, then leaves the random weights. Nothing is read
    in a way that could run code. Raises InputError where a file is missing, damaged, or of another network.
    """
    if setting == RANDOM:
        return "random"
    if setting == AUTO:
        try:
            with _impatient():
                weights = torch.hub.load_state_dict_from_url(
                    _IMAGENET, map_location="cpu", progress=False, check_hash=True, weights_only=True
                )
        except (URLError, OSError, RuntimeError) as error:
            return f"random, for ImageNet's weights are not at hand ({error})"
        where = "ImageNet"
    else:
        weights, where = _read(Path(setting).expanduser()), setting
    try:
        trunk.load_state_dict(used_weights(weights))
    except RuntimeError as error:
        lacking = " ".join(str(error).splitlines()[1:2]).strip()[:200]
        raise InputError(f"training.head.encoder_weights {where} is of another network: {lacking}", CHOICES) from error
    return where


def _read(path: Path) -> dict[str, Tensor]:
    check_readable(path)
    try:
        weights = load_file(path) if path.suffix == ".safetensors" else _from_torch(path)
    except (SafetensorError, RuntimeError, EOFError, OSError, KeyError, ValueError, pickle.UnpicklingError) as error:
        reason = str(error).partition("\n")[0] or type(error).__name__
        raise InputError(f"training.head.encoder_weights {path} is damaged ({reason})", CHOICES) from error
    if not isinstance(weights, dict) or not all(isinstance(name, str) for name in weights):
        raise InputError(f"training.head.encoder_weights {path} holds no weights by name", CHOICES)
    return weights


def _from_torch(path: Path) -> Any:
    with opened(path) as file:
        check_stored(file)
        return torch.load(file, "cpu", weights_only=True)


@contextmanager
def _impatient() -> Iterator[None]:
    """Give up on a network that does not answer."""
    before = socket.getdefaulttimeout()
    socket.setdefaulttimeout(_PATIENCE_S)
    try:
        yield
    finally:
        socket.setdefaulttimeout(before)
