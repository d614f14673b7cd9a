"""Training state on disk, with its digest at the end of each file. Nothing is read in a way that could run code."""

from __future__ import annotations

import hashlib
import io
import pickle
from pathlib import Path
from typing import Any, BinaryIO

import torch

from aug3d_core.run.atomic_file import replacing
from aug3d_core.run.errors import InputError
from aug3d_core.run.stored_archive import check_stored
from aug3d_core.training.divergence import WINDOW

_DIGEST_BYTES = hashlib.sha256().digest_size
STATE = "state-{:08d}.pt"
KEPT = 4  # windows: trouble is seen up to two after it began, and a second restart goes further back


class _Digested:
    """A file to write to, which digests what passes."""

    def __init__(self, file: BinaryIO) -> None:
        self._file = file
        self.sha256 = hashlib.sha256()

    def write(self, data: bytes | memoryview) -> int:
        self.sha256.update(data)
        return self._file.write(data)

    def flush(self) -> None:
        self._file.flush()


def save_state(folder: Path, step: int, state: dict[str, Any]) -> None:
    """Write the training state after a step; a kill or a power cut in between leaves the former ones."""
    folder.mkdir(exist_ok=True)
    path = folder / STATE.format(step)
    with replacing(path, path.with_suffix(".partial")) as file:
        digested = _Digested(file)
        torch.save(state, digested)  # pyright: ignore[reportArgumentType]  # it calls write and flush alone
        file.write(digested.sha256.digest())
    for old in _superfluous(saved_steps(folder)):
        (folder / STATE.format(old)).unlink()


def saved_steps(folder: Path) -> list[int]:
    """Return the steps of the states there are, in order."""
    return sorted(int(path.stem.partition("-")[2]) for path in folder.glob(STATE.replace("{:08d}", "*")))


def load_state(folder: Path, step: int) -> dict[str, Any]:
    """Read a training state; raises InputError if it is damaged."""
    path = folder / STATE.format(step)
    try:
        content = path.read_bytes()
        if hashlib.sha256(content[:-_DIGEST_BYTES]).digest() != content[-_DIGEST_BYTES:]:
            raise ValueError("it is not what was written")
        archive = io.BytesIO(content[:-_DIGEST_BYTES])
        check_stored(archive)
        return torch.load(archive, map_location="cpu", weights_only=True)
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
