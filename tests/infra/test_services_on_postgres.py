"""The services as `aug3d up` and compose start them, on a real PostgreSQL and behind a password, killed one after the other."""

from __future__ import annotations

import base64
import json
import os
import shutil
import signal
import subprocess
import sys
import time
import urllib.error
import urllib.request
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from tempfile import mkdtemp
from typing import Any

import psutil
import pytest
from typer.testing import CliRunner

from flows.cli import app
from flows.serving import PASSWORD
from tests.infra.postgres import Postgres, free_port
from tests.tests_support import hear_signals, words_of

pytestmark = pytest.mark.slow
SECRET = "correct horse battery"
_PATIENCE_S = 180.0


@dataclass
class Running:
    """What a test looks at: the process of `aug3d up`, its addresses, its database, and the folder of wishes."""

    up: subprocess.Popen
    home: Path
    prefect: str
    mlflow: str
    postgres: Postgres
    wishes: Path

    def ask(self, address: str, body: dict[str, Any], secret: str = SECRET) -> dict[str, Any]:
        """Post to one of the servers as `admin`."""
        user = base64.b64encode(f"admin:{secret}".encode()).decode()
        headers = {"Authorization": f"Basic {user}", "Content-Type": "application/json"}
        request = urllib.request.Request(address, json.dumps(body).encode(), headers)
        with urllib.request.urlopen(request, timeout=30) as answer:
            return json.load(answer)

    def flow_runs(self) -> list[str]:
        """Return what the completed flow runs were asked for."""
        completed = {"flow_runs": {"state": {"type": {"any_": ["COMPLETED"]}}}}
        return sorted(run["parameters"]["name"] for run in self.ask(f"{self.prefect}/api/flow_runs/filter", completed))

    def logged_runs(self) -> list[str]:
        """Return the names of MLflow's runs."""
        found = self.ask(f"{self.mlflow}/api/2.0/mlflow/runs/search", {"experiment_ids": ["0"]})
        return sorted(run["info"]["run_name"] for run in found.get("runs", []))

    def process(self, *words: str) -> psutil.Process:
        """Return the process of a service: the innermost whose command line has these words."""
        family = psutil.Process(self.up.pid).children(recursive=True)
        return [member for member in family if set(words) <= set(words_of(member))][-1]


def until(holds: Callable[[], bool]) -> None:
    deadline = time.monotonic() + _PATIENCE_S
    while time.monotonic() < deadline:
        try:
            if holds():
                return
        except (OSError, IndexError):
            pass
        time.sleep(0.3)
    pytest.fail("waited in vain")


@pytest.fixture(scope="module")
def running(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Running]:
    # pytest's own folder is closed to the user that PostgreSQL runs as.
    folder = Path(mkdtemp(prefix="aug3d-postgres-"))
    postgres = Postgres(folder, "prefect", "mlflow")
    home, wishes = tmp_path_factory.mktemp("home"), tmp_path_factory.mktemp("wishes")
    prefect, mlflow = free_port(), free_port()
    worker = [str(Path(__file__).with_name("a_worker.py")), str(wishes)]
    code = (
        "import os\nfrom pathlib import Path\nfrom flows.serving import Serving\n"
        "from flows.up import serve\n"
        f"serve(Serving(Path({str(home)!r}), '127.0.0.1', {prefect}, {mlflow}, os.environ[{PASSWORD!r}]), True, {worker})"
    )
    database = f"://aug3d@127.0.0.1:{postgres.port}"
    environment = {
        **{name: value for name, value in os.environ.items() if not name.startswith(("PREFECT", "MLFLOW"))},
        PASSWORD: SECRET,
        "PREFECT_API_DATABASE_CONNECTION_URL": f"postgresql+asyncpg{database}/prefect",
        "MLFLOW_BACKEND_STORE_URI": f"postgresql+psycopg2{database}/mlflow",
        "PYTHONPATH": str(Path(__file__).parents[2]),
        "PYTHONWARNINGS": "ignore",
    }
    with subprocess.Popen(
        [sys.executable, "-c", code], stdout=subprocess.PIPE, text=True, env=environment, preexec_fn=hear_signals
    ) as up:
        try:
            told = json.loads(up.stdout.readline())  # type: ignore[union-attr]
            yield Running(up, home, told["prefect"], told["mlflow"], postgres, wishes)
        finally:
            up.terminate()
            up.wait(60)
            postgres.kill()
            shutil.rmtree(folder)


def wish(running: Running, name: str) -> None:
    (running.wishes / f"{name}.wish").touch()


def recorded(running: Running, *names: str) -> bool:
    """Say whether both have one run of each name, and the worker knows that it has granted the wish."""
    granted = not list(running.wishes.glob("*.wish"))
    return granted and running.flow_runs() == list(names) == running.logged_runs()


def test_a_run_is_recorded_in_both(running: Running) -> None:
    wish(running, "first")
    until(lambda: recorded(running, "first"))
    assert not list(running.home.rglob("prefect.db")) and not list(running.home.glob("mlflow.db"))


def test_a_wrong_password_is_turned_away_by_both(running: Running) -> None:
    for address in (f"{running.prefect}/api/flow_runs/filter", f"{running.mlflow}/api/2.0/mlflow/runs/search"):
        with pytest.raises(urllib.error.HTTPError, match="401"):
            running.ask(address, {}, "wrong horse battery")


def test_no_password_is_in_a_command_line(running: Running) -> None:
    for member in psutil.Process(running.up.pid).children(recursive=True):
        assert SECRET not in " ".join(words_of(member))


def test_a_second_one_on_the_same_home_is_refused_and_names_the_first(running: Running) -> None:
    done = CliRunner().invoke(app, ["up", "--home", str(running.home)])
    assert done.exit_code == 2
    assert f"process {running.up.pid}" in done.output and running.prefect in done.output and "Ctrl-C" in done.output


def test_postgresql_is_killed_and_comes_back(running: Running) -> None:
    running.postgres.kill()
    running.postgres.start()
    wish(running, "second")
    until(lambda: recorded(running, "first", "second"))


def test_both_servers_and_the_worker_are_killed_and_come_back(running: Running) -> None:
    services = (("flows.web", "prefect"), ("flows.web", "mlflow"), (str(running.wishes),))
    for process in [running.process(*words) for words in services]:
        process.kill()
    wish(running, "third")
    until(lambda: recorded(running, "first", "second", "third"))


def test_ctrl_c_ends_everything(running: Running) -> None:
    family = psutil.Process(running.up.pid).children(recursive=True)
    assert len(family) >= 3
    running.up.send_signal(signal.SIGINT)
    running.up.wait(60)
    assert not [member for member in family if member.is_running() and member.status() != psutil.STATUS_ZOMBIE]
