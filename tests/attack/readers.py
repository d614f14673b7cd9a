"""Readers that load an engine, and whether what they return is right: finite numbers of the expected shape."""

from __future__ import annotations

from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from aug3d_core.heads.pixelnerf.resnet import ResNet34


def colmap(path: str) -> bool:
    """Read poses."""
    from aug3d_core.poses.recognise import recognise
    from aug3d_core.poses.stage import read_entries

    return _entries_are_right(read_entries(recognise(Path(path))))


def mega_nerf(path: str) -> bool:
    """Read a Mega-NeRF folder."""
    return colmap(path)


def sweep_start(path: str) -> bool:
    """Start a sweep from a file of weights; none of the files here is one."""
    from torch import nn

    from aug3d_core.heads.sweep.start import first_weights

    first_weights(nn.Linear(3, 2), path)
    return False


def encoder(path: str) -> bool:
    """Start the paper's encoder from a file of weights; none of the files here is one."""
    from aug3d_core.heads.pixelnerf.encoder_weights import start_trunk

    start_trunk(_trunk(), path)
    return False


@cache
def _trunk() -> ResNet34:
    """Draw its millions of first weights once."""
    from aug3d_core.heads.pixelnerf.resnet import ResNet34

    return ResNet34()


def trained_head(path: str) -> bool:
    """Open a trained head; none of the folders here is whole."""
    from aug3d_core.heads.saved import load

    load(Path(path))
    return False


def _entries_are_right(entries: list) -> bool:
    """Say whether every pose and camera is finite and every name stands once."""
    names = [entry.names[0][0] for entry in entries]
    return (
        bool(entries)
        and len(set(names)) == len(names)
        and all(
            np.isfinite(entry.cam_from_world).all() and np.isfinite(entry.names[0][1].params).all() for entry in entries
        )
    )
