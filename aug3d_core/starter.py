"""Start stages' processes quickly: by a fork of a process that has imported the common libraries (`starter_main.py`).

There is one such process for a factory, started with the first stage. It lives as long as the factory does, and dies with
it; so do all that it forked.
"""

from __future__ import annotations

import atexit
import json
import signal
import subprocess
import sys
import threading
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path

# What libraries read when they are imported: with other values they have to be imported anew.
_READ_AT_IMPORT = ("OMP_", "OPENBLAS_", "MKL_", "NUMEXPR_", "MPL", "LD_", "PYTHONHASHSEED")


class Process:
    """A process that was forked for a stage, with what one asks of a `subprocess.Popen`."""

    def __init__(self, pid: int) -> None:
        self.pid = pid
        self._returncode = 0
        self._ended = threading.Event()

    @property
    def returncode(self) -> int:
        """The exit code, or minus the number of the signal that ended it; 0 as long as it runs."""
        return self._returncode

    def poll(self) -> int | None:
        """Return the exit code, None as long as it runs."""
        return self._returncode if self._ended.is_set() else None

    def wait(self) -> int:
        """Wait for the end and return the exit code."""
        self._ended.wait()
        return self._returncode

    def end(self, returncode: int) -> None:
        """Take note of its end."""
        self._returncode = returncode
        self._ended.set()


class Starter:
    """A process that forks others to order."""

    def __init__(self, environment: Mapping[str, str]) -> None:
        self._server = subprocess.Popen(
            [sys.executable, "-m", "aug3d_core.starter_main"],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            start_new_session=True,  # Ctrl-C goes to the factory, which then ends its stages
            env=environment,
        )
        self._running: dict[int, Process] = {}
        self._started: Process | None = None
        self._listening = True
        self._one_order = threading.Lock()  # at a time: the answer does not say whose it is
        self._told = threading.Condition()
        threading.Thread(target=self._listen, name="ends of stages", daemon=True).start()

    @property
    def alive(self) -> bool:
        """Whether it takes orders."""
        return self._listening

    @property
    def idle(self) -> bool:
        """Whether nothing runs that it forked."""
        return not self._running

    def start(self, package: str, job: Path, log: Path, environment: Mapping[str, str]) -> Process:
        """Have `python -m package job` run in a process group of its own, with its output added to a log."""
        order = {"package": package, "job": str(job), "log": str(log), "environment": dict(environment)}
        assert self._server.stdin is not None
        with self._one_order, self._told:
            self._started = None
            with suppress(BrokenPipeError):  # told below
                self._server.stdin.write(json.dumps(order).encode() + b"\n")
                self._server.stdin.flush()
            self._told.wait_for(lambda: self._started is not None or not self._listening)
            if self._started is None:
                raise OSError(f"the process that starts stages ended with exit code {self._server.wait()}")
            return self._started

    def stop(self) -> None:
        """End it, and all that it forked."""
        assert self._server.stdin is not None
        with suppress(BrokenPipeError):
            self._server.stdin.close()
        self._server.wait()

    def _listen(self) -> None:
        assert self._server.stdout is not None
        with self._server.stdout as answers:
            for line in answers:
                answer = json.loads(line)
                with self._told:
                    if "started" in answer:
                        self._started = self._running[answer["started"]] = Process(answer["started"])
                    else:
                        self._running.pop(answer["ended"]).end(answer["returncode"])
                    self._told.notify_all()
        with self._told:  # it has ended, and the kernel has ended all that it forked
            self._listening = False
            for process in self._running.values():
                process.end(-signal.SIGKILL)
            self._running.clear()
            self._told.notify_all()


_lock = threading.Lock()
_starters: dict[tuple[tuple[str, str], ...], Starter] = {}


def start(package: str, job: Path, log: Path, environment: Mapping[str, str]) -> Process:
    """Run `python -m package job` in a process group of its own."""
    read = tuple(sorted((name, value) for name, value in environment.items() if name.startswith(_READ_AT_IMPORT)))
    with _lock:
        for key, other in list(_starters.items()):
            if (key != read and other.idle) or not other.alive:
                _starters.pop(key).stop()
        if read not in _starters:
            _starters[read] = Starter(environment)
        return _starters[read].start(package, job, log, environment)


@atexit.register
def stop() -> None:
    """End the processes that start stages."""
    while _starters:
        _starters.popitem()[1].stop()
