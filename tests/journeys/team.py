"""A team: `aug3d up` with the scene files, workers with homes of their own, one store at an S3 service. All real processes."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any
from urllib.error import HTTPError
from urllib.request import Request, urlopen

import psutil
import yaml

from aug3d_core.run.files import LOG
from tests.attack.town_process import stage_of
from tests.journeys.small_town import SETTINGS
from tests.store.s3_service import BUCKET, KEYS, free_port, s3_service
from tests.tests_support import hear_signals

AUG3D = str(Path(sys.executable).parent / "aug3d")


@dataclass
class Team:
    """What runs, and where. The machine of `aug3d up` takes no runs of scenes: workers do."""

    folder: Path
    store: dict[str, str]
    server: str = ""
    token: str = ""
    workers: dict[str, subprocess.Popen] = field(default_factory=dict)

    def ask(self, path: str, body: Any = None) -> Any:
        """Ask Prefect's API, again while its database is busy; a body is posted."""
        headers = {"Authorization": f"Bearer {self.token}", "Content-Type": "application/json"}
        data = None if body is None else json.dumps(body).encode()
        for _ in range(20):
            try:
                with urlopen(Request(f"{self.server}/api/{path}", data, headers), timeout=60) as answer:
                    return json.loads(answer.read())
            except HTTPError as error:
                if error.code != 503:
                    raise
                time.sleep(1)
        raise AssertionError(f"{path}: Prefect's database is always busy")

    def start(self, name: str, **parameters: Any) -> str:
        """Start what is deployed under a name and return the run's id."""
        [deployed] = [one for one in self.ask("deployments/filter", {}) if one["name"] == name]
        return self.ask(f"deployments/{deployed['id']}/create_flow_run", {"parameters": parameters})["id"]

    def start_all(self) -> str:
        """Start the batch of all scenes and return its id."""
        return self.start("all scenes")

    def run(self, flow_run: str) -> dict[str, Any]:
        """Return a flow run as it is now."""
        return self.ask(f"flow_runs/{flow_run}")

    def end_of(self, flow_run: str, seconds: float) -> dict[str, Any]:
        """Wait for a flow run to end, and return its last state."""
        self.wait(lambda: self.run(flow_run)["end_time"] is not None, seconds, "the batch ends")
        return self.run(flow_run)["state"]

    def scenes(self) -> dict[str, dict[str, Any]]:
        """Return the runs of scenes, by scene."""
        runs = self.ask("flow_runs/filter", {})
        return {run["parameters"]["scene"]: run for run in runs if "scene" in run["parameters"]}

    def status(self) -> dict[str, Any]:
        """Return what `aug3d status` tells on the machine of `aug3d up`."""
        words = [AUG3D, "status", "--json", "--home", str(self.folder / "up")]
        done = subprocess.run(words, env=self._environment({}), capture_output=True, text=True)
        assert done.returncode == 0, done.stderr + done.stdout
        return json.loads(done.stdout)

    def join(self, name: str, core: int | None = None) -> None:
        """Start a worker with a home of its own, on one core if one is named, and wait until it takes runs."""
        words = [AUG3D, "worker", "--server", self.server, "--home", str(self.folder / name)]
        pinned = [] if core is None else ["taskset", "-c", str(core)]
        self.workers[name] = self._begin(name, [*pinned, *words], {"PREFECT_API_AUTH_STRING": f"admin:{self.token}"})
        self.wait(lambda: "takes runs" in self.log(name), 120, f"{name} takes runs", self.workers[name])

    def at_work(self, stage: str) -> list[str]:
        """Return which workers have a process that makes a stage."""
        families = {name: psutil.Process(one.pid).children(recursive=True) for name, one in self.workers.items()}
        return [name for name, family in families.items() if stage in map(stage_of, family)]

    def log(self, name: str) -> str:
        """Return what a process of the team has said."""
        return (self.folder / f"{name}.log").read_text()

    def kill(self, name: str) -> None:
        """End a worker as a power cut does."""
        self.workers[name].kill()
        self.workers.pop(name).wait()

    def made(self) -> Counter[str]:
        """Return how often each object was made: of one that was brought from others a home has no log."""
        logs = self.folder.glob(f"*/objects/*/*/{LOG}")
        return Counter(f"{log.parents[1].name} {log.parent.name}" for log in logs)

    def has_made(self, stage: str) -> bool:
        """Say whether an object of a stage is there."""
        return any(name.startswith(f"{stage} ") for name in self.made())

    def wait(self, so: Callable[[], bool], seconds: float, what: str, process: subprocess.Popen | None = None) -> None:
        """Wait until something is so; fail with the logs if it never is."""
        deadline = time.monotonic() + seconds
        while not so():
            ended = process is not None and process.poll() is not None
            if ended or time.monotonic() > deadline:
                logs = {file.name: file.read_text()[-3000:] for file in self.folder.glob("*.log")}
                raise AssertionError(f"not in {seconds:.0f} s: {what}\n" + "\n".join(map("\n".join, logs.items())))
            time.sleep(0.5)

    def up(self) -> subprocess.Popen:
        """Start `aug3d up`."""
        ports = free_port(), free_port()
        words = [AUG3D, "up", "--prefect-port", str(ports[0]), "--mlflow-port", str(ports[1])]
        process = self._begin("up", [*words, "--home", str(self.folder / "up")], {"AUG3D_QUEUE": "gpu"})
        self.wait(lambda: "ready after" in self.log("up"), 240, "aug3d up is ready", process)
        self.server = f"http://127.0.0.1:{ports[0]}"
        self.token = (self.folder / "up" / "services" / "token").read_text()
        return process

    def _begin(self, name: str, words: list[str], more: Mapping[str, str]) -> subprocess.Popen:
        with (self.folder / f"{name}.log").open("a") as log:
            return subprocess.Popen(words, stdout=log, stderr=log, preexec_fn=hear_signals, env=self._environment(more))

    def _environment(self, more: Mapping[str, str]) -> dict[str, str]:
        given = {key: value for key, value in os.environ.items() if not key.startswith(("PREFECT_", "MLFLOW_"))}
        return {**given, **self.store, **more}


@contextmanager
def team(folder: Path, scenes: Mapping[str, Mapping[str, Any]], workers: tuple[str, ...]) -> Iterator[Team]:
    """Start a team for scenes of small towns, given what each has of its own settings; end it in the end."""
    (folder / "up" / "scenes").mkdir(parents=True)
    for scene, own in scenes.items():
        settings = {stage: {**SETTINGS.get(stage, {}), **own.get(stage, {})} for stage in {*SETTINGS, *own}}
        entry = {"photos": None, "preset": "tiny", "settings": settings}
        (folder / "up" / "scenes" / f"{scene}.yaml").write_text(yaml.safe_dump(entry))
    with ExitStack() as stack:
        address = stack.enter_context(s3_service())
        store = {**KEYS, "AWS_ENDPOINT_URL": address, "AUG3D_STORE": f"s3://{BUCKET}/team"}
        made = Team(folder, store)
        up = made.up()
        try:
            for name in workers:
                made.join(name)
            yield made
        finally:
            for process in (*made.workers.values(), up):
                process.send_signal(signal.SIGINT)
            for process in (*made.workers.values(), up):
                process.wait(60)
