"""One run of the small town in a process of its own, watched from outside: which stage is at work, who lives, how it ends."""

from __future__ import annotations

import json
import shutil
import subprocess
import sys
import time
from collections.abc import Callable, Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any

import psutil

from aug3d_core.bench.small_town import OVERRIDES
from aug3d_core.bench.team import stage_of
from aug3d_core.factory.stages import FROM_TOWN
from aug3d_core.run.files import LOG
from aug3d_core.store import layout
from aug3d_core.store.scenes import step_objects
from tests.tests_support import words_of

ORDER = [stage.name for stage in FROM_TOWN]
_LOOK_S = 0.05


class TownRun:
    """A running `aug3d demo`. Whoever waits for it gives a limit: a hang is an answer, not a test that never ends."""

    def __init__(self, home: Path, logs: Path) -> None:
        logs.mkdir(exist_ok=True)
        number = len(list(logs.glob("*.out")))
        self.home, self.started = home, time.monotonic()
        self._before = self._versions()
        self.out, self.progress = logs / f"{number:03d}.out", logs / f"{number:03d}.err"
        words = [str(Path(sys.executable).parent / "aug3d"), "demo", "--json", "--home", str(home), *OVERRIDES]
        with self.out.open("w") as out, self.progress.open("w") as progress:
            self.factory = subprocess.Popen(words, stdout=out, stderr=progress)

    def wait_for(self, so: Callable[[], bool], limit_s: float) -> bool:
        """Wait until something is so, and say whether it is; False if the run has ended. Raises TimeoutError."""
        deadline = time.monotonic() + limit_s
        while self.factory.poll() is None:
            if so():
                return True
            if time.monotonic() > deadline:
                raise TimeoutError
            time.sleep(_LOOK_S)
        return False

    def wait(self, limit_s: float) -> None:
        """Wait for the end. Raises TimeoutError."""
        self.wait_for(lambda: False, limit_s)

    def living(self) -> list[psutil.Process]:
        """Return the factory and all that it started, if they live."""
        with suppress(psutil.NoSuchProcess):
            factory = psutil.Process(self.factory.pid)
            return [one for one in (factory, *factory.children(recursive=True)) if _lives(one)]
        return []

    def stage(self) -> str:
        """Return the stage that has a process, "" if none has."""
        return next(filter(None, map(stage_of, self.living())), "")

    def kind(self, process: psutil.Process) -> str:
        """Return what a process of this run is: `stage` and `worker` work for the stage, all others for the run."""
        words, name = " ".join(words_of(process)), stage_of(process)
        if process.pid == self.factory.pid:
            return "factory"
        for word, kind in (("flows.web", "Prefect's server"), ("resource_tracker", "resource tracker")):
            if word in words:
                return kind
        if name:
            return "stage"
        if "multiprocessing.forkserver" in words:  # a stage that has not yet called itself so looks like its server
            return "fork server" if process.ppid() == self.factory.pid else "stage"
        return "worker" if "aug3d_core" in words else f"other: {words[:80]}"

    def reached(self, stage: str) -> bool:
        """Say whether this run works at a stage, or at one after it."""
        now = self.stage()
        return bool(now) and ORDER.index(now) >= ORDER.index(stage)

    def past_look(self) -> bool:
        """Say whether this run has found that the disk has room: Prefect's server follows."""
        return "everything goes to" in self.progress.read_text()

    def past_stages(self) -> bool:
        """Say whether this run has told the end of the last stage: a report and MLflow follow."""
        return f" {ORDER[-1]}: " in self.progress.read_text()

    def past_report(self) -> bool:
        """Say whether this run has written its version: MLflow follows."""
        return self._versions() > self._before

    def _versions(self) -> int:
        return len(list((self.home / layout.SCENES / "demo").glob(f"*/{layout.METRICS}")))

    def told(self) -> dict[str, Any]:
        """Return the JSON that an ended run printed; raises ValueError if it is none."""
        return json.loads(self.out.read_text())

    def end(self) -> None:
        """End the run, and all that has to end with it."""
        for process in reversed(self.living()):
            with suppress(psutil.NoSuchProcess):
                process.kill()
        self.factory.wait()


def digests(told: Mapping[str, Any]) -> dict[str, str]:
    """Return the digest of each stage's object by what a run told."""
    return {name: figures["digest"] for name, figures in told["stages"].items()}


def begun(home: Path, stage: str) -> bool:
    """Say whether the store has an object of a stage at work, or left by a kill."""
    return any((home / layout.WORK / stage).glob(f"*/{LOG}"))


def made(home: Path, stage: str) -> bool:
    """Say whether the store has an object of a stage."""
    return any((home / layout.OBJECTS / stage).glob(f"[!.]*/{layout.RECORD}"))


def hand_over(told: Mapping[str, Any], home: Path, but: tuple[str, ...]) -> None:
    """Copy what a run has made, by what it told, into a home, but for the objects of some steps."""
    store = Path(told["paths"]["metrics"]).parents[3]
    for step, (stage, key) in step_objects(told).items():
        if step not in but:
            shutil.copytree(store / layout.OBJECTS / stage / key, home / layout.OBJECTS / stage / key)


def damaged(home: Path) -> list[str]:
    """Return what `aug3d verify` names."""
    aug3d = str(Path(sys.executable).parent / "aug3d")
    looked = subprocess.run([aug3d, "verify", "--home", str(home), "--json"], capture_output=True, text=True)
    return [f"damaged: {one}" for one in json.loads(looked.stdout)["damaged"]]


def _lives(process: psutil.Process) -> bool:
    try:
        return process.status() != psutil.STATUS_ZOMBIE
    except psutil.Error:
        return False
