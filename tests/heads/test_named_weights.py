"""What is said of first weights before a run is what training would say of them."""

from __future__ import annotations

import os
from pathlib import Path

import pytest
import torch
from safetensors.torch import save_file

from aug3d_core.heads.head import build
from aug3d_core.heads.sweep.config import RANDOM, TOWNS, SweepConfig
from aug3d_core.heads.sweep.named_weights import check_named
from aug3d_core.run.errors import InputError


def weights(features: int, **more: int) -> dict[str, torch.Tensor]:
    return build(SweepConfig(features=features, start=RANDOM, **more)).state_dict()


def of_another_head(path: Path) -> None:
    save_file({"fine.leave.weight": torch.zeros(3)}, path)


FILES = {
    "fitting": lambda path: save_file(weights(16), path),
    "of other planes, which fit": lambda path: save_file(weights(16, planes=8, fine_planes=3), path),
    "wider": lambda path: save_file(weights(20), path),
    "of another head": of_another_head,
    "no weights": lambda path: path.write_bytes(b"not weights at all"),
    "empty": lambda path: path.touch(),
    "a pickle": lambda path: torch.save(weights(16), path),
    "a folder": lambda path: path.mkdir(),
    "a pipe": lambda path: os.mkfifo(path),
    "missing": lambda path: None,
}


@pytest.mark.parametrize("features", [16, 20])
@pytest.mark.parametrize("which", FILES)
def test_a_file_is_refused_before_a_run_where_training_refuses_it(which: str, features: int, tmp_path: Path) -> None:
    path = tmp_path / "weights.safetensors"
    FILES[which](path)
    config = SweepConfig(features=features, start=str(path))
    try:
        build(config).start()
    except InputError:
        with pytest.raises(InputError, match=f"training.head.start: .*{path}"):
            check_named(config)
    else:
        check_named(config)


@pytest.mark.parametrize("start", [TOWNS, RANDOM])
def test_weights_that_are_no_file_are_not_looked_for(start: str) -> None:
    check_named(SweepConfig(start=start, features=20))
