"""A look at the file of first weights that the settings name: before a run too, so without torch."""

from __future__ import annotations

from pathlib import Path

from aug3d_core.heads.pixelnerf.config import PixelNerfConfig
from aug3d_core.run.errors import InputError
from aug3d_core.run.regular_file import opened

CHOICES = (
    "set training.head.encoder_weights to auto, random, or a file of torchvision's resnet34 (.pth or .safetensors)"
)


def check_named(config: PixelNerfConfig) -> None:
    """Raise InputError that names the file of the encoder's weights if it cannot be read."""
    for file in config.files:
        check_readable(file)


def check_readable(path: Path) -> None:
    """Raise InputError unless this is a file that can be read."""
    try:
        opened(path).close()
    except OSError as error:
        raise InputError(
            f"training.head.encoder_weights {path} is no file that can be read ({error.strerror})", CHOICES
        ) from error
