"""Kill `aug3d up`, its servers, its worker and what that runs, at random moments: a run that was asked for ends as ever."""

from __future__ import annotations

import json
import random
import signal
import subprocess
import sys
import time
from collections import Counter
from pathlib import Path
from typing import Any
from urllib.error import URLError

import psutil
import pytest

from aug3d_core.store.scenes import versions
from aug3d_core.store.store import Store
from tests.attack.town_process import damaged, digests
from tests.journeys.test_daily_use import ask, deployment_of, free_port, wait, write_entry
from tests.tests_support import hear_signals, words_of

KILLS = 30
OF_A_HOME = 4
PAUSE_S = (1.0, 30.0)  # between two kills: a server is back after 10 s, a run takes a minute or two
HANG_S = 900.0  # from the last kill on
SERVICES = {"flows.web prefect": "Prefect's server", "flows.web mlflow": "MLflow's server", "flows.worker": "worker"}
VICTIMS = ("aug3d up", *SERVICES.values(), "what the worker runs")
ENDS = ("COMPLETED", "FAILED", "CRASHED", "CANCELLED")

pytestmark = [pytest.mark.slow, pytest.mark.attack, pytest.mark.long, pytest.mark.timeout(3 * 3600)]


class Up:
    """A running `aug3d up`, which can be killed and started again."""

    def __init__(self, home: Path) -> None:
        self.home, self.ports, self._log = home, (free_port(), free_port()), home.with_suffix(".log")
        self.pages = {"prefect": f"http://127.0.0.1:{self.ports[0]}"}
        self.start()

    def start(self) -> None:
        """Start it, and wait until it is ready."""
        ports = [word for name, port in zip(("prefect", "mlflow"), self.ports, strict=True)
                 for word in (f"--{name}-port", str(port))]  # fmt: skip
        with self._log.open("w") as log:
            self.process = subprocess.Popen(
                [str(Path(sys.executable).parent / "aug3d"), "up", "--home", str(self.home), *ports],
                stdout=log, stderr=log, preexec_fn=hear_signals,
            )  # fmt: skip
        wait(lambda: "ready after" in self.told() or self.process.poll() is not None, HANG_S, "aug3d up is ready")
        assert self.process.poll() is None, self.told()
        self.pages["token"] = (self.home / "services" / "token").read_text()

    def told(self) -> str:
        """Return what it printed since its last start."""
        return self._log.read_text()

    def kill(self, victim: str, rng: random.Random) -> bool:
        """Kill what has this name; False if nothing has now. `aug3d up` itself is started again."""
        family = psutil.Process(self.process.pid).children(recursive=True)
        named = {child: next((SERVICES[each] for each in SERVICES if each in " ".join(words_of(child))), "")
                 for child in family}  # fmt: skip
        if victim == "aug3d up":
            self.process.kill()
            self.process.wait()
            _, alive = psutil.wait_procs(family, timeout=30)
            assert not alive, f"these outlive aug3d up: {[words_of(one) for one in alive]}"
            self.start()
            return True
        if victim in named.values():
            chosen = [child for child, name in named.items() if name == victim][:1]
        else:
            worker = next((child for child, name in named.items() if name == "worker"), None)
            chosen = worker.children(recursive=True) if worker else []
        if not chosen:
            return False
        rng.choice(chosen).kill()
        return True

    def runs(self) -> list[dict[str, Any]]:
        """Return the runs of deployments, once the server answers."""
        found: list[dict[str, Any]] = []

        def answered() -> bool:
            try:
                found[:] = ask(self.pages, "flow_runs/filter", {"sort": "EXPECTED_START_TIME_ASC"})
            except (URLError, ConnectionError, TimeoutError):
                return False
            return True

        wait(answered, HANG_S, "Prefect's server answers")
        return [run for run in found if run["deployment_id"]]

    def ask_for_the_town(self) -> str:
        """Ask for a run of the town and return its id; asked again if the server was away."""
        while True:
            try:
                return ask(self.pages, f"deployments/{deployment_of(self.pages, 'town')['id']}/create_flow_run", {})[
                    "id"
                ]
            except (URLError, ConnectionError, TimeoutError, StopIteration):
                time.sleep(1)

    def end(self) -> None:
        """Press Ctrl-C; all that it started ends."""
        family = psutil.Process(self.process.pid).children(recursive=True)
        self.process.send_signal(signal.SIGINT)
        assert self.process.wait(60) in (0, 130)
        _, left = psutil.wait_procs(family, timeout=20)
        assert not left, [words_of(one) for one in left]


def test_killed_at_random_the_run_that_was_asked_for_ends_as_untouched(
    small_town: tuple[Path, dict[str, Any]], tmp_path: Path
) -> None:
    rng, kills, ends = random.Random(7), Counter[str](), Counter[str]()
    while kills.total() < KILLS:
        home = tmp_path / f"home{ends.total()}"
        home.mkdir(mode=0o700)
        write_entry(home)
        up = Up(home)
        asked, left = [up.ask_for_the_town()], OF_A_HOME
        while True:
            until = time.monotonic() + rng.uniform(*PAUSE_S) if left else float("inf")
            begun = time.monotonic()
            while (state := _end(up, asked[-1])) not in ENDS and time.monotonic() < until:
                assert time.monotonic() - begun < HANG_S, f"{home}: {state} after {dict(kills)}"
                time.sleep(0.5)
            if state == "COMPLETED":
                break
            if state in ENDS:  # as a user would
                ends[f"{state}, asked again"] += 1
                assert len(asked) <= OF_A_HOME + 1, f"{home}: asked {len(asked)} times"
                asked.append(up.ask_for_the_town())
                continue
            victim = rng.choice(VICTIMS)
            if up.kill(victim, rng):
                kills[victim] += 1
                left -= 1
                print(f"{kills.total()} {victim}", flush=True)
        ends["COMPLETED"] += 1
        wait(lambda up=up: all(run["state"]["type"] in ENDS for run in up.runs()), HANG_S, "all runs have an end")
        assert "Traceback" not in up.told()
        up.end()
        version = versions(Store(home), "town")[-1]  # after those of runs that failed
        assert digests(json.loads((version / "metrics.json").read_bytes())) == digests(small_town[1])
        assert not damaged(home)
        print(f"{dict(ends)} {dict(kills)}", flush=True)
    assert set(kills) == set(VICTIMS)


def _end(up: Up, run_id: str) -> str:
    """Return the state of a run; it has crashed if it stays so."""
    state = _state(up, run_id)
    if state == "CRASHED":
        time.sleep(5.0)
        state = _state(up, run_id)
    return state


def _state(up: Up, run_id: str) -> str:
    return next((run["state"]["type"] for run in up.runs() if run["id"] == run_id), "lost")
