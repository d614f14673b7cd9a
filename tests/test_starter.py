"""Stages' processes are forked, but behave as if each had been started by itself."""

from __future__ import annotations

import os
import signal
import textwrap
import threading
import time
from pathlib import Path

import psutil
import pytest

from aug3d_core.starter import Process, Starter

_SAYS = """
    import json, os, signal, sys, time
    from pathlib import Path

    job = json.loads(Path(sys.argv[1]).read_text())
    print("argv", len(sys.argv), "main", __name__, flush=True)
    print("group", os.getpgid(0) == os.getpid(), "flag", os.environ.get("FLAG"), file=sys.stderr)
    if "signal" in job:
        os.kill(os.getpid(), job["signal"])
    time.sleep(job.get("seconds", 0))
    sys.exit(job.get("code", 0))
"""


@pytest.fixture
def starter(tmp_path: Path):
    (tmp_path / "tests_says").mkdir()
    (tmp_path / "tests_says" / "__init__.py").touch()
    (tmp_path / "tests_says" / "__main__.py").write_text(textwrap.dedent(_SAYS))
    starter = Starter(os.environ)
    yield starter
    starter.stop()


def begin(starter: Starter, folder: Path, job: str = "{}") -> Process:
    file = folder / f"{threading.get_ident()}-{time.monotonic_ns()}.json"
    file.write_text(job)
    environment = {**os.environ, "PYTHONPATH": str(folder), "FLAG": "up"}
    return starter.start("tests_says", file, file.with_suffix(".log"), environment)


def test_a_process_is_as_if_started_by_itself(starter: Starter, tmp_path: Path) -> None:
    assert begin(starter, tmp_path).wait() == 0
    log = next(tmp_path.glob("*.log"))
    assert log.read_text() == "argv 2 main __main__\ngroup True flag up\n"
    assert starter.idle and starter.alive


@pytest.mark.parametrize(
    ("job", "code"), [('{"code": 3}', 3), ('{"signal": 11}', -signal.SIGSEGV), ("no json", 1), ('{"code": "x"}', 1)]
)
def test_how_it_ended_is_told(starter: Starter, tmp_path: Path, job: str, code: int) -> None:
    process = begin(starter, tmp_path, job)
    assert process.wait() == code == process.poll() == process.returncode


def test_many_at_once_are_not_mixed_up(starter: Starter, tmp_path: Path) -> None:
    codes: dict[int, int] = {}

    def one(code: int) -> None:
        codes[code] = begin(starter, tmp_path, f'{{"code": {code}, "seconds": {0.05 * (code % 3)}}}').wait()

    threads = [threading.Thread(target=one, args=(code,)) for code in range(12)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert codes == {code: code for code in range(12)}


def test_it_takes_what_it_forked_with_it_and_says_so(tmp_path: Path, starter: Starter) -> None:
    process = begin(starter, tmp_path, '{"seconds": 600}')
    assert process.poll() is None
    psutil.Process(process.pid).parent().kill()  # type: ignore[union-attr]
    assert process.wait() == -signal.SIGKILL
    for _ in range(600):
        if not psutil.pid_exists(process.pid) or psutil.Process(process.pid).status() == psutil.STATUS_ZOMBIE:
            break
        time.sleep(0.05)
    else:
        raise AssertionError("it lives on")
    with pytest.raises(OSError, match="ended with exit code -9"):
        begin(starter, tmp_path)
    assert not starter.alive
