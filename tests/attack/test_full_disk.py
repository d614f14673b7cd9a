"""A home on a disk that fills up: every command says so in its own words, and in JSON where that was asked for."""

from __future__ import annotations

import json
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

import pytest

from tests.photos.photo_files import write_photo

DISK_MIB = 1400  # what the look before the run wants is free, at first
AFTER_S = (1.0, 3.0)  # until something else fills the disk


@pytest.fixture
def small_disk(tmp_path: Path) -> Iterator[Path]:
    disk = tmp_path / "disk"
    disk.mkdir()
    done = subprocess.run(["mount", "-t", "tmpfs", "-o", f"size={DISK_MIB}m", "tmpfs", str(disk)], capture_output=True)
    if done.returncode:
        pytest.skip("may not mount a small disk here")
    yield disk
    subprocess.run(["umount", "-l", str(disk)], check=True)


@pytest.mark.slow
@pytest.mark.attack
@pytest.mark.parametrize("after_s", AFTER_S)
def test_a_disk_that_fills_up_during_a_run_is_named_and_nothing_is_lost(
    small_disk: Path, tmp_path: Path, after_s: float
) -> None:
    for seed in range(6):
        write_photo(tmp_path / "photos" / f"{seed}.jpg", seed=seed, size=(800, 600))
    home = small_disk / "home"
    aug3d = str(Path(sys.executable).with_name("aug3d"))
    words = ["run", "hill", "--photos", str(tmp_path / "photos"), "--home", str(home), "--json"]
    run = subprocess.Popen([aug3d, *words], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    time.sleep(after_s)
    fill(small_disk / "else")
    out, progress = run.communicate(timeout=300)
    assert "Traceback" not in progress, progress[-3000:]
    assert run.returncode == 1
    said = json.dumps(json.loads(out)["failure"])
    looked_first = "may need" in said and "are free" in said  # it was full before the run looked
    assert looked_first or ("no space left on the disk" in said and "MiB free" in said)
    (small_disk / "else").unlink()
    looked = subprocess.run([aug3d, "verify", "--home", str(home), "--json"], capture_output=True, text=True)
    assert json.loads(looked.stdout)["damaged"] == []


def fill(file: Path) -> None:
    with suppress(OSError), file.open("wb", buffering=0) as other:
        while True:
            other.write(bytes(1 << 20))
    with suppress(OSError), file.open("ab", buffering=0) as other:
        while True:
            other.write(bytes(512))
