"""A team: `aug3d up` with the scene files, workers with homes of their own, one store at an S3 service. All real processes."""

from __future__ import annotations

import json
import os
import secrets
import signal
import subprocess
import sys
import time
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any
from urllib.error import HTTPError
from urllib.request import Request, urlopen

import psutil
import yaml

from aug3d_core.bench.s3_service import BUCKET, KEYS, address_of, free_port, s3_process
from aug3d_core.bench.small_town import SETTINGS
from aug3d_core.factory.stages import FROM_TOWN
from aug3d_core.run.errors import Aug3dError
from aug3d_core.run.files import LOG
from aug3d_core.run.linux_process import die_with_parent
from aug3d_core.store import layout
from aug3d_core.store.machine_name import machine_name
from aug3d_core.store.scenes import step_objects

AUG3D = str(Path(sys.executable).parent / "aug3d")
_STAGES = [stage.name for stage in FROM_TOWN]
_NAMED = "aug3d "  # how a stage's process calls itself, of which the kernel keeps 15 characters
_OTHERS = ("AUG3D_", "AWS_", "MLFLOW_", "PREFECT_")  # variables that would lead a team to something that is not its own
_WORKER = "prefect.worker.name"  # label of a run: machine, home and queues of its worker
_ASK_EVERY_S = 2.0  # an answer costs Prefect's server 30 ms of a processor, which the team shares
_GONE_S = 60.0  # until nothing of what ended, or was killed, may live


class TeamFailed(Aug3dError):
    """A team did not get where it should have; the problem holds the last words of all its processes."""


@dataclass
class Team:
    """What runs, and where. The machine of `aug3d up` takes no runs of scenes: workers do."""

    folder: Path
    store: dict[str, str]
    service: subprocess.Popen
    server: str = ""
    token: str = ""
    workers: dict[str, subprocess.Popen] = field(default_factory=dict)
    first: subprocess.Popen | None = None  # `aug3d up`

    def ask(self, path: str, body: Any = None) -> Any:
        """Ask Prefect's API, again while it or its database is busy; a body is posted."""
        headers = {"Authorization": f"Bearer {self.token}", "Content-Type": "application/json"}
        data = None if body is None else json.dumps(body).encode()
        for _ in range(20):
            try:
                with urlopen(Request(f"{self.server}/api/{path}", data, headers), timeout=60) as answer:
                    return json.loads(answer.read())
            except OSError as error:
                if isinstance(error, HTTPError) and error.code != 503:
                    raise
                time.sleep(1)
        raise self._failed(f"{path}: Prefect is always busy")

    def start(self, name: str, on: str | None = None, **parameters: Any) -> str:
        """Start what is deployed under a name, on one worker if one is named, and return the run's id."""
        [deployed] = [one for one in self.ask("deployments/filter", {}) if one["name"] == name]
        asked: dict[str, Any] = {"parameters": parameters, "idempotency_key": secrets.token_hex(8)}  # `ask` asks again
        if on is not None:
            asked["work_queue_name"] = self.machine(on)  # the queue of its own
        return self.ask(f"deployments/{deployed['id']}/create_flow_run", asked)["id"]

    def start_all(self) -> str:
        """Start the batch of all scenes and return its id."""
        return self.start("all scenes")

    def run(self, flow_run: str) -> dict[str, Any]:
        """Return a flow run as it is now."""
        return self.ask(f"flow_runs/{flow_run}")

    def end_of(self, flow_run: str, seconds: float) -> dict[str, Any]:
        """Wait for a flow run to end, and return its last state."""
        self.wait(lambda: self.run(flow_run)["end_time"] is not None, seconds, "the batch ends", every_s=_ASK_EVERY_S)
        return self.run(flow_run)["state"]

    def scenes(self) -> dict[str, dict[str, Any]]:
        """Return the runs of scenes, by scene."""
        runs = self.ask("flow_runs/filter", {})
        return {run["parameters"]["scene"]: run for run in runs if "scene" in run["parameters"]}

    def worker_of(self, scene: str) -> str:
        """Return which worker makes a scene, or has made it; "" if none does that lives."""
        machine = self.scenes().get(scene, {}).get("labels", {}).get(_WORKER, "").rpartition(" (")[0]
        return next((name for name in self.workers if self.machine(name) == machine), "")

    def machine(self, name: str) -> str:
        """Return how Prefect calls the machine that a process of the team stands for: its workers' names begin so."""
        return machine_name((self.folder / name).resolve())

    def status(self) -> dict[str, Any]:
        """Return what `aug3d status` tells on the machine of `aug3d up`."""
        words = [AUG3D, "status", "--json", "--home", str(self.folder / "up")]
        done = subprocess.run(words, env=self._environment({}), capture_output=True, text=True)
        if done.returncode:
            raise self._failed(f"aug3d status ends with {done.returncode}: {done.stderr}{done.stdout}")
        return json.loads(done.stdout)

    def join(self, name: str, core: int | None = None, more: Mapping[str, str] = {}) -> None:
        """Start a worker with a home of its own, on one core if one is named, and wait until it takes runs.

        more: variables of its environment.
        """
        words = [AUG3D, "worker", "--server", self.server, "--home", str(self.folder / name)]
        self.workers[name] = self._begin(name, words, {"PREFECT_API_AUTH_STRING": f"admin:{self.token}", **more}, core)
        self.wait(lambda: "takes runs" in self.log(name), 120, f"{name} takes runs", self.workers[name])

    def stages(self, name: str) -> set[str]:
        """Return the stages for which a worker has a process."""
        return {*filter(None, map(stage_of, psutil.Process(self.workers[name].pid).children(recursive=True)))}

    def at_work(self, stage: str) -> list[str]:
        """Return which workers have a process that makes a stage."""
        return [name for name in self.workers if stage in self.stages(name)]

    def log(self, name: str) -> str:
        """Return what a process of the team has said."""
        return (self.folder / f"{name}.log").read_text()

    def kill(self, name: str) -> None:
        """End a worker as a power cut does, and wait until nothing of it lives."""
        self.workers[name].kill()
        self.workers.pop(name).wait()
        if alive := leftovers(self.folder / name):
            raise self._failed(f"of {name}, which was killed, these live on: {alive}")

    def shared_s(self) -> float:
        """Return the processor time so far of what workers share, `aug3d up` and the store's service [s]."""
        return sum(_spent_s(process) for process in (self.service, self.first) if process)

    @contextmanager
    def store_away(self) -> Iterator[None]:
        """Let the store's service answer nothing, and keep what it holds: a machine that hangs, a network that is cut."""
        self.service.send_signal(signal.SIGSTOP)
        try:
            yield
        finally:
            self.service.send_signal(signal.SIGCONT)

    def made(self) -> Counter[str]:
        """Return how often each object was made, by its stage and key."""
        return times_made(self._logs(), self._computed())

    def wait(
        self,
        so: Callable[[], bool],
        seconds: float,
        what: str,
        process: subprocess.Popen | None = None,
        every_s: float = 0.5,
    ) -> None:
        """Wait until something is so; raise TeamFailed with the logs if it never is."""
        deadline = time.monotonic() + seconds
        while not so():
            ended = process is not None and process.poll() is not None
            if ended or time.monotonic() > deadline:
                raise self._failed(f"not in {seconds:.0f} s: {what}")
            time.sleep(every_s)

    def up(self) -> subprocess.Popen:
        """Start `aug3d up`."""
        ports = free_port(), free_port()
        words = [AUG3D, "up", "--prefect-port", str(ports[0]), "--mlflow-port", str(ports[1])]
        process = self.first = self._begin("up", [*words, "--home", str(self.folder / "up")], {"AUG3D_QUEUE": "gpu"})
        self.wait(lambda: "ready after" in self.log("up"), 240, "aug3d up is ready", process)
        self.server = f"http://127.0.0.1:{ports[0]}"
        self.token = (self.folder / "up" / "services" / "token").read_text()
        return process

    def _begin(self, name: str, words: list[str], more: Mapping[str, str], core: int | None = None) -> subprocess.Popen:
        parent = os.getpid()

        def as_child() -> None:
            die_with_parent(signal.SIGTERM, parent)
            if core is not None:
                os.sched_setaffinity(0, {core})

        with (self.folder / f"{name}.log").open("a") as log:
            return subprocess.Popen(words, stdout=log, stderr=log, preexec_fn=as_child, env=self._environment(more))

    def _environment(self, more: Mapping[str, str]) -> dict[str, str]:
        given = {key: value for key, value in os.environ.items() if not key.startswith(_OTHERS)}
        return {**given, **self.store, **more}

    def _logs(self) -> Iterator[tuple[str, str]]:
        """Yield home and object for each log: of an object that was brought from others a home has none."""
        for log in self.folder.glob(f"*/{layout.OBJECTS}/*/*/{LOG}"):
            yield log.relative_to(self.folder).parts[0], f"{log.parents[1].name} {log.parent.name}"

    def _computed(self) -> set[tuple[str, str, str]]:
        """Return home, version and object for each step that a version says was made for it."""
        found = set()
        for file in self.folder.glob(f"*/{layout.SCENES}/*/*/{layout.METRICS}"):
            told = json.loads(file.read_bytes())
            version = Path(told["paths"]["metrics"]).relative_to(
                self.folder.resolve()
            )  # where it was made: others bring it
            for step, (stage, key) in step_objects(told).items():
                if not told["stages"][step]["cached"]:
                    found.add((version.parts[0], str(version), f"{stage} {key}"))
        return found

    def _failed(self, problem: str) -> TeamFailed:
        logs = [f"{file.name}: {file.read_text()[-3000:]}" for file in sorted(self.folder.glob("*.log"))]
        return TeamFailed(
            "\n".join([problem, *logs]), f"see the logs in {self.folder}, and what else this machine does"
        )


def times_made(logs: Iterable[tuple[str, str]], computed: Iterable[tuple[str, str, str]]) -> Counter[str]:
    """Return how often each object was made.

    logs: home and object, for each object with a log in a home. computed: home, version and object, for each step that a
    version says it made. Each alone leaves something out: a run that was killed has no version, and of an object that another
    machine had finished first no log stays.
    """
    computed = set(computed)
    told = {(home, name) for home, _, name in computed}
    return Counter([name for _, _, name in computed]) + Counter([name for home, name in {*logs} - told])


def _spent_s(process: subprocess.Popen) -> float:
    """Return the processor time of a process and of all that it started, ended or not [s]."""
    first, spent = psutil.Process(process.pid), 0.0
    for one in (first, *first.children(recursive=True)):
        with suppress(psutil.Error):
            times = one.cpu_times()
            spent += times.user + times.system + times.children_user + times.children_system
    return spent


def stage_of(process: psutil.Process) -> str:
    """Return the stage that a process makes, "" if none."""
    try:
        name = process.name()
    except psutil.Error:
        return ""
    named = name.removeprefix(_NAMED)
    return next((stage for stage in _STAGES if name != named and stage.startswith(named)), "")


def leftovers(home: Path) -> list[str]:
    """Return the commands that still run for a home: stages, renderers, Prefect's server. They may take a minute to end."""
    deadline = time.monotonic() + _GONE_S
    while alive := list(_working_for(home)):
        if time.monotonic() > deadline:
            return alive
        time.sleep(0.2)
    return []


def _working_for(home: Path) -> Iterator[str]:
    for process in psutil.process_iter(["cmdline"]):
        with suppress(psutil.Error):
            mine = process.environ().get("PREFECT_HOME") == str(home / layout.PREFECT)
            if process.pid != os.getpid() and mine and process.status() != psutil.STATUS_ZOMBIE:
                yield " ".join(process.info["cmdline"] or ())


@contextmanager
def team(folder: Path, scenes: Mapping[str, Mapping[str, Any]], workers: tuple[str, ...]) -> Iterator[Team]:
    """Start a team for scenes of small towns, given what each has of its own settings; end it in the end."""
    (folder / "up" / "scenes").mkdir(parents=True)
    for scene, own in scenes.items():
        settings = {stage: {**SETTINGS.get(stage, {}), **own.get(stage, {})} for stage in {*SETTINGS, *own}}
        entry = {"photos": None, "preset": "tiny", "settings": settings}
        (folder / "up" / "scenes" / f"{scene}.yaml").write_text(yaml.safe_dump(entry))
    with ExitStack() as stack:
        port = free_port()
        service = stack.enter_context(s3_process(port))
        store = {**KEYS, "AWS_ENDPOINT_URL": address_of(port), "AUG3D_STORE": f"s3://{BUCKET}/team"}
        made = Team(folder, store, service)
        up = made.up()
        try:
            for name in workers:
                made.join(name)
            yield made
        finally:
            for process in (*made.workers.values(), up):
                process.terminate()
            for process in (*made.workers.values(), up):
                process.wait(60)
