"""Photographs that cannot work end in one clear sentence and exit code 1, through the whole factory."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

pytestmark = [pytest.mark.slow, pytest.mark.timeout(900)]


def refuse(tmp_path: Path, folder: Path, served: dict[str, str]) -> dict[str, str]:
    """Run the factory; return the failure it told, after checking that it left a record of it."""
    aug3d = str(Path(sys.executable).parent / "aug3d")
    home = tmp_path / "home"
    words = [aug3d, "run", "bad", "--photos", str(folder), "--json", "--home", str(home)]
    done = subprocess.run(words, capture_output=True, text=True, env=served)
    assert done.returncode == 1, done.stderr
    told = json.loads(done.stdout)
    assert told["state"] == "refused"
    shown = subprocess.run([aug3d, "show", "bad", "--json", "--home", str(home)], capture_output=True, text=True)
    assert json.loads(shown.stdout)["failure"] == told["failure"]
    return told["failure"]


def noise_photo(path: Path, seed: int) -> None:
    pixels = np.random.default_rng(seed).integers(0, 255, (30, 40, 3), np.uint8)
    Image.fromarray(pixels).resize((400, 300), Image.Resampling.BICUBIC).save(path, quality=90)


def test_thirty_photos_of_nothing_in_common(tmp_path: Path, served: dict[str, str]) -> None:
    folder = tmp_path / "photos"
    folder.mkdir()
    for seed in range(30):
        noise_photo(folder / f"{seed:02d}.jpg", seed)
    failure = refuse(tmp_path, folder, served)
    assert "no scene could be reconstructed" in failure["problem"] and "30" in failure["problem"]
    assert "overlap by 60 %" in failure["remedy"]
