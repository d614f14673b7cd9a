"""Stages' processes are forked, but behave as if each had been started by itself."""

from __future__ import annotations

import errno
import os
import signal
import subprocess
import sys
import textwrap
import threading
import time
from collections.abc import Callable
from multiprocessing import forkserver
from multiprocessing.popen_fork import Popen
from pathlib import Path

import psutil
import pytest

from aug3d_core.run.fork_server import LOST, _read_by_server, _read_once, start
from tests.tests_support import wait_until_dead

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


@pytest.fixture(autouse=True)
def says(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "tests_says").mkdir()
    (tmp_path / "tests_says" / "__init__.py").touch()
    (tmp_path / "tests_says" / "__main__.py").write_text(textwrap.dedent(_SAYS))
    monkeypatch.syspath_prepend(tmp_path)
    # Some library that other tests of this process load sets such a variable: then stages are not forked
    for name, value in (_read_once() | _read_by_server()).items():
        monkeypatch.setenv(name, value) if name in _read_by_server() else monkeypatch.delenv(name)


def begin(folder: Path, job: str = "{}") -> Popen:
    file = folder / f"{threading.get_ident()}-{time.monotonic_ns()}.json"
    file.write_text(job)
    return start("tests_says", file, file.with_suffix(".log"), {**os.environ, "FLAG": "up"})


def test_a_process_is_as_if_started_by_itself(tmp_path: Path) -> None:
    assert begin(tmp_path).wait() == 0
    log = next(tmp_path.glob("*.log"))
    assert log.read_text() == "argv 2 main __main__\ngroup True flag up\n"


@pytest.mark.parametrize(
    ("job", "code"), [('{"code": 3}', 3), ('{"signal": 11}', -signal.SIGSEGV), ("no json", 1), ('{"code": "x"}', 1)]
)
def test_how_it_ended_is_told(tmp_path: Path, job: str, code: int) -> None:
    process = begin(tmp_path, job)
    assert process.wait() == code == process.poll() == process.returncode


def test_a_log_that_cannot_be_opened_is_told_by_the_exit_code_alone(
    tmp_path: Path, small_disk: Callable[[int], Path]
) -> None:
    disk = small_disk(1)
    subprocess.run(["mount", "-o", "remount,nr_inodes=1", str(disk)], check=True)  # its own folder takes the only one
    with pytest.raises(OSError, match=os.strerror(errno.ENOSPC)):
        (disk / "log").touch()
    code = f"""
import os, sys
from pathlib import Path
from aug3d_core.run.fork_server import LOST, start
sys.exit(start("tests_says", Path({str(tmp_path / "job")!r}), Path({str(disk / "log")!r}), os.environ).wait())
"""
    told = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=60)
    assert (told.returncode, told.stdout, told.stderr) == (errno.ENOSPC, "", "")


def test_many_at_once_are_not_mixed_up(tmp_path: Path) -> None:
    codes: dict[int, int] = {}

    def one(code: int) -> None:
        codes[code] = begin(tmp_path, f'{{"code": {code}, "seconds": {0.05 * (code % 3)}}}').wait()

    threads = [threading.Thread(target=one, args=(code,)) for code in range(12)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert codes == {code: code for code in range(12)}


def test_stages_end_with_their_server_and_the_next_stage_gets_a_new_one(tmp_path: Path) -> None:
    process = begin(tmp_path, '{"seconds": 600}')
    assert process.poll() is None
    server = forkserver._forkserver._forkserver_pid  # type: ignore[attr-defined]
    assert psutil.Process(process.pid).ppid() == server  # and not this process
    psutil.Process(server).kill()
    assert process.wait() == LOST
    wait_until_dead(process.pid)
    assert begin(tmp_path).wait() == 0


def test_the_server_ends_with_the_factory_even_if_a_stage_lives_on(tmp_path: Path) -> None:
    """A stage inherits a pipe that keeps the server alive; it has to close it."""
    code = f"""
import os, sys
from pathlib import Path
from aug3d_core.run.fork_server import LOST, _read_by_server, _read_once, start
from tests.tests_support import wait_until_dead
sys.path.insert(0, {str(tmp_path)!r})
process = start("tests_says", Path({str(tmp_path / "job")!r}), Path({str(tmp_path / "log")!r}), os.environ)
while "flag" not in Path({str(tmp_path / "log")!r}).read_text(): pass
print(process.pid, flush=True)
os.kill(os.getpid(), 9)
"""
    (tmp_path / "job").write_text('{"seconds": 600}')
    (tmp_path / "log").touch()
    said = subprocess.run([sys.executable, "-c", code], stdout=subprocess.PIPE, timeout=60)
    wait_until_dead(int(said.stdout))


def test_a_changed_variable_that_libraries_read_once_is_heeded(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    assert begin(tmp_path).wait() == 0  # the server runs now
    (tmp_path / "tests_says" / "__main__.py").write_text("print(hash('stage'))")
    monkeypatch.setenv("PYTHONHASHSEED", "7")
    expected = subprocess.run([sys.executable, "-c", "print(hash('stage'))"], stdout=subprocess.PIPE, text=True)
    for _ in range(2):
        assert begin(tmp_path).wait() == 0
        assert max(tmp_path.glob("*.log")).read_text() == expected.stdout


def test_the_factorys_own_code_is_not_imported(tmp_path: Path) -> None:
    """A module that only the factory has imported is not in the stage."""
    main = tmp_path / "tests_says" / "__main__.py"
    main.write_text(
        "import sys\nprint(*(name for name in sys.modules if name.startswith(('aug3d', 'tests_', 'prefect'))))"
    )
    assert begin(tmp_path).wait() == 0
    assert set(next(tmp_path.glob("*.log")).read_text().split()) == {
        "aug3d_core", "aug3d_core.run", "aug3d_core.run.fork_server", "aug3d_core.run.linux_process", "tests_says",
    }  # fmt: skip


def test_a_server_that_was_stopped_goes_on_when_a_stage_is_asked_of_it(tmp_path: Path) -> None:
    assert begin(tmp_path).wait() == 0
    server = forkserver._forkserver._forkserver_pid  # pyright: ignore[reportAttributeAccessIssue]
    os.kill(server, signal.SIGSTOP)
    assert begin(tmp_path).wait() == 0
    assert psutil.Process(server).status() != psutil.STATUS_STOPPED
