# ruff: noqa: E501  (tables of inputs)
"""Malformed files of tensors: poses as Mega-NeRF keeps them, and weights."""

from __future__ import annotations

import json
import os
import pickle
import re
import shutil
import struct
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import torch
from safetensors.torch import save_file

from aug3d_core.heads import saved
from aug3d_core.heads.config import FIRST, config_of
from aug3d_core.heads.head import build
from tests.run.test_stored_archive import LARGE, bomb

_GOOD = {"c2w": torch.eye(4)[:3], "W": 320, "H": 240, "intrinsics": torch.tensor([300.0, 300.0, 160.0, 120.0])}


def write(folder: str) -> None:
    """Write all of them."""
    root = Path(folder)
    for name, told in _metadata().items():
        _mega_nerf(root / "mega" / name, told)
    for name in ("raw", "pipe", "cut"):
        _mega_nerf(root / "mega" / name, _GOOD)
        file = root / "mega" / name / "train" / "metadata" / "000001.pt"
        content = file.read_bytes()
        file.unlink()
        os.mkfifo(file) if name == "pipe" else file.write_bytes(content[:300] if name == "cut" else b"no zip")
    _bombs(root)
    _weights(root)
    _heads(root / "heads")


def _metadata() -> dict[str, Any]:
    bad: dict[str, Any] = {
        "expanded": torch.zeros(1).expand(2**32), "expanded_matrix": torch.zeros(1, 1).expand(2**16, 2**16), "scalar": torch.tensor(1.0),
        "empty": torch.zeros(0), "nan": torch.full((3, 4), torch.nan), "complex": torch.zeros(3, 4, dtype=torch.complex64),
        "sparse": torch.eye(4).to_sparse(), "half": torch.eye(4).bfloat16(), "meta": torch.zeros(3, 4, device="meta"), "text": "x", "list": [[1.0]],
        "huge": [10**400] * 12, "none": None, "dictionary": {"a": 1}, "bool": torch.ones(3, 4, dtype=torch.bool), "grad": torch.eye(4).requires_grad_(),
        "nested": torch.zeros(3, 4, 1, 1),
    }  # fmt: skip
    made = {f"{key}_{name}": {**_GOOD, key: value} for key in ("c2w", "W", "intrinsics") for name, value in bad.items()}
    made |= {f"without_{key}": {k: v for k, v in _GOOD.items() if k != key} for key in _GOOD}
    return made | {
        "all_list": [1, 2],
        "all_tensor": torch.eye(3),
        "all_pickle": _Pickle(),
        "all_empty": {},
        "keys": {1: 2},
    }


class _Pickle:
    """Would write a file if it were unpickled."""

    def __reduce__(self) -> tuple[Any, ...]:
        return os.system, ("exit 1",)


def _mega_nerf(folder: Path, told: Any) -> None:
    (folder / "train" / "metadata").mkdir(parents=True)
    torch.save({"origin_drb": torch.zeros(3), "pose_scale_factor": 1.0}, folder / "coordinates.pt")
    torch.save(told, folder / "train" / "metadata" / "000001.pt")


def _bombs(root: Path) -> None:
    """Write archives whose entries claim far more than they have."""
    for entry in ("data.pkl", "version", "data/0"):
        folder = root / "mega" / f"bomb_{entry.replace('/', '_')}"
        _mega_nerf(folder, _GOOD)
        bomb(folder / "train" / "metadata" / "000001.pt", entry, LARGE)
    torch.save({"conv1.weight": torch.zeros(3)}, root / "bomb.pth")
    bomb(root / "bomb.pth", "data/0", LARGE)


def _weights(root: Path) -> None:
    save_file({"weight": torch.zeros(5, 5)}, root / "other.safetensors")
    content = (root / "other.safetensors").read_bytes()
    (root / "cut.safetensors").write_bytes(content[:-10])
    (root / "empty.safetensors").write_bytes(b"")
    (root / "short.safetensors").write_bytes(content[:5])
    for name, head in _headers().items():
        text = head.encode() if isinstance(head, str) else json.dumps(head).encode()
        (root / f"{name}.safetensors").write_bytes(struct.pack("<Q", len(text)) + text + bytes(16))
    (root / "length.safetensors").write_bytes(struct.pack("<Q", 2**63) + b"{}")
    torch.save(_Pickle(), root / "pickle.pth")
    torch.save([1], root / "list.pth")
    torch.save({"conv1.weight": torch.zeros(1).expand(2**33)}, root / "expanded.pth")
    torch.save({"conv1.weight": "x"}, root / "text.pth")
    torch.save({1: 2}, root / "keys.pth")
    torch.save(torch.zeros(2), root / "tensor.pth")
    (root / "plain.pth").write_bytes(pickle.dumps({"a": 1}))
    (root / "empty.pth").write_bytes(b"")


def _headers() -> Mapping[str, Any]:
    promise = {"dtype": "F32", "shape": [2**30, 2**30], "data_offsets": [0, 2**62]}
    return {
        "promise": {"weight": promise}, "past": {"weight": {"dtype": "F32", "shape": [9], "data_offsets": [0, 36]}},
        "negative": {"weight": {"dtype": "F32", "shape": [-1], "data_offsets": [0, 4]}}, "dtype": {"weight": {"dtype": "X9", "shape": [4], "data_offsets": [0, 16]}},
        "overlap": {"weight": {"dtype": "F32", "shape": [4], "data_offsets": [0, 16]}, "bias": {"dtype": "F32", "shape": [4], "data_offsets": [0, 16]}},
        "deep": "[" * 100_000, "list": [1], "words": "weights", "nothing": {},
    }  # fmt: skip


def _heads(root: Path) -> None:
    whole = root / "whole"
    whole.mkdir(parents=True)
    saved.save(build(config_of(FIRST).model_validate({"name": FIRST, "encoder_weights": "random"})), whole)
    config = whole / "model.json"
    texts = {"deep": "[" * 100_000, "empty": "", "list": "[]", "null": "null", "no_head": '{"head": {"name": "magic"}}', "digits": re.sub(r": [0-9.]+", ": " + "9" * 5000, config.read_text()), "nan": re.sub(r": [0-9.]+", ": NaN", config.read_text()), "head_text": '{"head": "x"}', "head_list": '{"head": {"name": []}}'}  # fmt: skip
    for name, text in texts.items():
        shutil.copytree(whole, root / name)
        (root / name / "model.json").write_text(text)
    for name in ("model.json", "model.safetensors"):
        folder = root / f"pipe_{name}"
        shutil.copytree(whole, folder)
        (folder / name).unlink()
        os.mkfifo(folder / name)
    shutil.copytree(whole, root / "cut")
    data = (root / "cut" / "model.safetensors").read_bytes()
    (root / "cut" / "model.safetensors").write_bytes(data[: len(data) // 2])
    shutil.copytree(whole, root / "other")
    save_file({"weight": torch.zeros(1)}, root / "other" / "model.safetensors")
    shutil.rmtree(whole)
