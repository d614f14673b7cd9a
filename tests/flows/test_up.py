"""`aug3d up`: what it refuses, and that nothing it started is ever left behind. The servers are tried in tests/infra."""

from __future__ import annotations

import json
import os
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import psutil
import pytest
from filelock import FileLock
from typer.testing import CliRunner

from aug3d_core.run.errors import StoreError
from flows.cli import app
from flows.serving import PASSWORD, WORKER, Serving
from flows.supervisor import Supervised
from flows.up import check_ports
from tests.tests_support import hear_signals

# A worker that is ready at once, has a process of its own, and lives until it is killed.
_WORKER = """
import os, subprocess, sys, time
from http.server import BaseHTTPRequestHandler, HTTPServer
from pathlib import Path
from flows.services import ready_file
with open(os.environ["AUG3D_HOME"] + "/family", "a") as file:
    child = subprocess.Popen([sys.executable, "-c", "import time; time.sleep(600)"], start_new_session=True)
    print(os.getpid(), child.pid, file=file)
ready_file(Path(os.environ["AUG3D_HOME"])).touch()
time.sleep(600)
"""
_UP = """
import sys
import threading
from contextlib import suppress
from http.server import BaseHTTPRequestHandler, HTTPServer
from pathlib import Path
import typer
from flows.refusal import typed_errors
from flows.serving import WORKER, Serving
from flows.supervisor import Stopped, Supervised, Supervisor, terminable
def main(home: Path, worker: str):
    serving = Serving(home)
    serving.folder.mkdir()
    services = [Supervised(WORKER, serving, ["-c", worker])]
    with typed_errors(False), suppress(Stopped), terminable(), Supervisor(services, print) as supervisor:
        supervisor.start(WORKER)
        print("ready", flush=True)
        supervisor.watch()
typer.run(main)
"""


def invoke(*arguments: str | Path):
    return CliRunner().invoke(app, ["up", *map(str, arguments)])


@contextmanager
def up(home: Path) -> Iterator[subprocess.Popen]:
    """Supervise one worker, as `aug3d up` does."""
    command = [sys.executable, "-c", _UP, str(home), _WORKER]
    root = Path(__file__).parents[2]
    environment = {**os.environ, "PYTHONPATH": str(root)}
    with subprocess.Popen(
        command, stdout=subprocess.PIPE, text=True, env=environment, preexec_fn=hear_signals
    ) as process:
        try:
            while process.stdout.readline() != "ready\n":  # type: ignore[union-attr]
                assert process.poll() is None
            yield process
        finally:
            process.kill()


def families(home: Path) -> list[list[int]]:
    """Return the process ids of every worker that was started, each with its child."""
    return [[int(pid) for pid in line.split()] for line in (home / "family").read_text().splitlines()]


def lives(pid: int) -> bool:
    return psutil.pid_exists(pid) and psutil.Process(pid).status() != psutil.STATUS_ZOMBIE


def until(holds: Callable[[], bool]) -> None:
    deadline = time.monotonic() + 60
    while not holds():
        assert time.monotonic() < deadline
        time.sleep(0.05)


def test_a_port_in_use_is_told_with_who_holds_it(tmp_path: Path) -> None:
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
        result = invoke("--home", tmp_path, "--mlflow-port", port)
    assert result.exit_code == 2
    assert f"port {port} is in use by process {os.getpid()}" in result.output and "--mlflow-port" in result.output


def test_both_pages_on_one_port(tmp_path: Path) -> None:
    result = invoke("--home", tmp_path, "--mlflow-port", 4321, "--prefect-port", 4321)
    assert result.exit_code == 2 and "cannot both have port 4321" in result.output


def test_an_address_of_another_machine(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(PASSWORD, "quite long enough")
    result = invoke("--home", tmp_path, "--host", "192.0.2.7")
    assert result.exit_code == 2 and "cannot listen on 192.0.2.7" in result.output


def test_a_host_that_others_reach_without_a_password(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv(PASSWORD, raising=False)
    result = invoke("--home", tmp_path / "home", "--host", "0.0.0.0", "--json")
    assert result.exit_code == 2 and PASSWORD in json.loads(result.stdout)["failure"]["remedy"]
    assert not (tmp_path / "home").exists()


def test_a_home_that_cannot_be_used(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("x")
    result = invoke("--home", tmp_path / "file")
    assert result.exit_code == 1 and "cannot be opened" in result.output


def test_a_home_that_another_serves_before_it_has_told_where(tmp_path: Path) -> None:
    (tmp_path / "services").mkdir()
    with FileLock(tmp_path / "services" / "up.lock"):
        result = invoke("--home", tmp_path)
    assert result.exit_code == 2 and "another aug3d up serves" in result.output


def test_free_ports_are_taken_without_a_word() -> None:
    with socket.create_server(("127.0.0.1", 0)) as one, socket.create_server(("127.0.0.1", 0)) as other:
        ports = one.getsockname()[1], other.getsockname()[1]
    check_ports(Serving(Path(), "127.0.0.1", *ports))


def test_a_service_that_does_not_start_is_told_with_its_last_words(tmp_path: Path) -> None:
    serving = Serving(tmp_path)
    serving.folder.mkdir()
    service = Supervised(WORKER, serving, ["-c", "raise SystemExit('no room at the inn')"])
    service.start()
    with pytest.raises(StoreError, match=r"worker did not start.*\n.*no room at the inn") as failed:
        service.wait_until_healthy()
    assert "worker.log" in failed.value.remedy


def test_one_that_dies_young_again_and_again_is_waited_for_longer(tmp_path: Path) -> None:
    serving = Serving(tmp_path)
    serving.folder.mkdir()
    service = Supervised(WORKER, serving, ["-c", "print('no room'); raise SystemExit(3)"])
    told = []
    for _ in range(3):
        service.start()
        service.process.wait()
        told.append(service.died())
        assert service.died() is None  # told once
    assert [f"in {seconds} s" in str(text) for seconds, text in zip((1, 2, 4), told, strict=True)] == [True] * 3
    assert all("worker ended with exit code 3" in str(text) and "no room" in str(text) for text in told)


@pytest.mark.slow
def test_a_worker_that_is_killed_is_started_again_and_leaves_no_process_behind(tmp_path: Path) -> None:
    with up(tmp_path) as process:
        worker, child = families(tmp_path)[0]
        os.kill(worker, signal.SIGKILL)
        until(lambda: len(families(tmp_path)) == 2)
        assert not lives(worker) and not lives(child)
        process.terminate()
        assert process.wait(60) == 0
        assert "worker was killed by SIGKILL; starting it again in 1 s" in process.stdout.read()  # type: ignore[union-attr]
    assert not any(lives(pid) for family in families(tmp_path) for pid in family)


@pytest.mark.slow
@pytest.mark.parametrize(("number", "code"), [(signal.SIGINT, 130), (signal.SIGHUP, 0)])
def test_ctrl_c_and_a_closed_terminal_end_the_worker_and_what_it_started(
    number: signal.Signals, code: int, tmp_path: Path
) -> None:
    with up(tmp_path) as process:
        process.send_signal(number)
        assert process.wait(60) == code
    assert not any(lives(pid) for pid in families(tmp_path)[0])
