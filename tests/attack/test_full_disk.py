"""A home on a disk that fills up: every command says so in its own words, and in JSON where that was asked for."""

from __future__ import annotations

import json
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import Any

import pytest

from aug3d_core.bench.team import leftovers
from aug3d_core.store import layout
from tests.attack.town_process import ORDER, TownRun, damaged, digests, made
from tests.photos.photo_files import write_photo
from tests.tests_support import fill

DISK_MIB = 1400  # what the look before the run wants is free, at first
AFTER_S = (1.0, 3.0)  # until something else fills the disk
HANG_S = 600.0
FROM_THE_LOOK_S = (0.0, 0.5, 1.0, 1.5, 2.0, 3.0, 4.0, 6.0)  # of a run at what is free on: servers start
FROM_THE_END_S = (0.0, 0.5, 1.0, 2.0)  # of the last stage on: the report; then again from the report on: MLflow
FREED_AGAIN_S = 0.05


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
    assert not damaged(home)


@pytest.mark.slow
@pytest.mark.attack
@pytest.mark.long
@pytest.mark.timeout(2 * 3600)
def test_a_disk_that_fills_up_at_any_stage_is_named_and_nothing_is_lost(
    small_disk: Path, tmp_path: Path, small_town: tuple[Path, dict[str, Any]]
) -> None:
    home, wrong, counts = small_disk / "home", [], {"failed": 0, "well": 0}

    def attack(where: str, attacked: TownRun, then_s: float = 0.0) -> None:
        time.sleep(then_s)
        with kept_full(small_disk / "else"):
            try:
                attacked.wait(HANG_S)
            except TimeoutError:
                wrong.append(f"{where}: hangs; {attacked.living()}")
                attacked.end()
        counts["well" if attacked.factory.returncode in (0, 3) else "failed"] += 1
        found = [*_wrong(attacked), *damaged(home), *leftovers(home)]
        print(f"{where}: exit code {attacked.factory.returncode} {found or ''}", flush=True)
        wrong.extend(f"{where}: {one}" for one in found)

    for after_s in FROM_THE_LOOK_S:
        run = TownRun(home, tmp_path / "logs")
        run.wait_for(run.past_look, HANG_S)
        attack(f"{after_s} s after the look", run, after_s)
    for stage in ORDER:
        run, known = TownRun(home, tmp_path / "logs"), {name for name in ORDER if made(home, name)}
        assert run.wait_for(partial(run.reached, stage), HANG_S), _told(run)
        attack(stage, run)
        wrong += [f"{stage}: {name} is lost" for name in known if not made(home, name)]
    for last in ("past_stages", "past_report"):
        for after_s in FROM_THE_END_S:
            for told in (home / layout.SCENES).glob(f"*/*/{layout.TOLD}"):
                told.unlink()  # else there is nothing to do, and nothing is written
            run = TownRun(home, tmp_path / "logs")
            run.wait_for(getattr(run, last), HANG_S)
            attack(f"{after_s} s {last}", run, after_s)
    freed = TownRun(home, tmp_path / "logs")
    freed.wait(HANG_S)
    assert freed.factory.returncode in (0, 3), _told(freed)
    print(f"\n{counts}")
    assert not wrong
    assert counts["failed"] >= len(ORDER)
    assert digests(freed.told()) == digests(small_town[1])
    assert all(figures["cached"] for figures in freed.told()["stages"].values())


def _wrong(run: TownRun) -> list[str]:
    """Say what is wrong with how a run ended on a full disk."""
    progress = run.progress.read_text()
    wrong = [f"a traceback: {progress[-3000:]}"] if "Traceback" in progress else []
    try:
        told = run.told()
    except ValueError:
        return [*wrong, f"no JSON: {_told(run)}"]
    if run.factory.returncode in (0, 3):  # it needed no more room
        return wrong
    said = json.dumps(told.get("failure"))
    named = (("may need", "are free"), ("no space left on the disk", "MiB free"))
    if not any(all(words in said for words in pair) for pair in named):
        wrong.append(f"does not name the disk: {_told(run)}")
    return wrong if run.factory.returncode == 1 else [*wrong, _told(run)]


def _told(run: TownRun) -> str:
    return f"exit code {run.factory.returncode}: {run.out.read_text()[-500:]} {run.progress.read_text()[-2000:]}"


@contextmanager
def kept_full(file: Path) -> Iterator[None]:
    """Fill a disk, and take at once what is freed on it, until the block ends."""
    over = threading.Event()

    def keep() -> None:
        while not over.wait(FREED_AGAIN_S):
            fill(file)

    fill(file)
    keeping = threading.Thread(target=keep)
    keeping.start()
    try:
        yield
    finally:
        over.set()
        keeping.join()
        file.unlink()
