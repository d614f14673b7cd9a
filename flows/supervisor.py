"""Keep the services running: start them, wait for their health, start again what died, and leave nothing behind."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress

import psutil

from aug3d_core.run.errors import StoreError
from aug3d_core.run.linux_process import SUPERVISED, adopt_orphans
from aug3d_core.run.process import log_tail
from flows.services import clients, healthy, ready_file
from flows.serving import MLFLOW, PREFECT, WORKER, Serving

_PATIENCE_S = 180.0  # a busy machine needs far longer than an idle one's 10 s
_GOOD_BYE_S = 10.0  # for the worker to tell Prefect what becomes of its runs
_POLL_S = 0.25
_LONGEST_PAUSE_S = 60.0
_SETTLED_S = 60.0  # a service that lived this long is started again at once

Say = Callable[[str], None]


class Stopped(Exception):
    """Somebody asked the services to end, or closed their terminal."""


@contextmanager
def terminable() -> Iterator[None]:
    """Let SIGTERM and the end of the terminal end the services as Ctrl-C does."""

    def stop(*_: object) -> None:
        raise Stopped

    before = {number: signal.getsignal(number) for number in (signal.SIGTERM, signal.SIGHUP)}
    for number, handler in before.items():
        if handler != signal.SIG_IGN:  # nohup asks to live on
            signal.signal(number, stop)
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


class Supervised:
    """One service: its process, and how often it died lately."""

    process: subprocess.Popen  # the last one, once it was started

    def __init__(self, name: str, serving: Serving, arguments: Sequence[str]) -> None:
        self.name = name
        self.log = serving.folder / f"{name}.log"
        self.pause_s = 1.0
        self.due = 0.0  # when to start it again; 0: it runs
        self.starts = 0
        self._serving = serving
        self._arguments = [sys.executable, *arguments]
        own = clients(serving) if name == WORKER else {}
        self._environment = {
            **os.environ,
            **serving.as_environment(),
            **own,
            SUPERVISED: str(os.getpid()),
            "PYTHONUNBUFFERED": "1",
        }

    def start(self) -> None:
        """Start it in a session of its own: Ctrl-C reaches `aug3d up` alone, which ends the others in order."""
        if self.name == WORKER:
            ready_file(self._serving.home).unlink(missing_ok=True)  # an earlier one's
        with self.log.open("ab" if self.starts else "wb") as log:  # why it died is kept, earlier days are not
            self.process = subprocess.Popen(
                self._arguments,
                stdin=subprocess.DEVNULL,
                stdout=log,
                stderr=log,
                start_new_session=True,
                env=self._environment,
            )
        self.started, self.due, self.starts = time.monotonic(), 0.0, self.starts + 1

    def wait_until_healthy(self) -> float:
        """Return the seconds it took; raises StoreError if it ended instead, or takes for ever."""
        while not healthy(self.name, self._serving):
            if self.process.poll() is not None or time.monotonic() - self.started > _PATIENCE_S:
                raise StoreError(
                    f"the service {self.name} did not start; it last said:\n{log_tail(self.log)}",
                    f"look at {self.log}, mend what it says, and start again",
                )
            time.sleep(_POLL_S)
        return time.monotonic() - self.started

    def died(self) -> str | None:
        """Return how it ended, once, and plan its next start: later each time that it dies young."""
        if self.due or self.process.poll() is None:
            return None
        if time.monotonic() - self.started > _SETTLED_S:
            self.pause_s = 1.0
        self.due = time.monotonic() + self.pause_s
        code = self.process.returncode
        how = f"was killed by {signal.Signals(-code).name}" if code < 0 else f"ended with exit code {code}"
        last_words = log_tail(self.log).rpartition("\n")[2] if code > 0 else ""
        told = f"{self.name} {how}; starting it again in {self.pause_s:.0f} s (log: {self.log}) {last_words}".rstrip()
        self.pause_s = min(2 * self.pause_s, _LONGEST_PAUSE_S)
        return told


class Supervisor:
    """The services of one home. Use it as a context: leaving it ends everything that was started."""

    def __init__(self, services: Sequence[Supervised], say: Say) -> None:
        self._services = services
        self._say = say

    def __enter__(self) -> Supervisor:
        adopt_orphans()
        return self

    def start(self, *names: str) -> None:
        """Start these services side by side, and wait for their health; raises StoreError if one does not start."""
        chosen = [service for service in self._services if service.name in names]
        for service in chosen:
            service.start()
        for service in chosen:
            self._say(f"{service.name} is healthy after {service.wait_until_healthy():.0f} s")

    def watch(self) -> None:
        """Start again what dies, until interrupted."""
        while True:
            for service in self._services:
                if how := service.died():
                    self._say(how)
                    self._end_strays()
                elif service.due and time.monotonic() >= service.due:
                    service.start()
                    self._say(f"{service.name} is started again")
            time.sleep(_POLL_S)

    def __exit__(self, *_: object) -> None:
        try:
            for names in ((WORKER,), (PREFECT, MLFLOW)):  # the worker may still have something to tell the servers
                self._end([s for s in self._services if s.name in names and s.starts])
        finally:  # whoever presses Ctrl-C again does not want to wait
            self._end_strays(all_of_them=True)

    def _end(self, services: Sequence[Supervised]) -> None:
        for service in services:
            self._say(f"ending {service.name}")
            service.process.terminate()
        deadline = time.monotonic() + _GOOD_BYE_S
        for service in services:
            with suppress(subprocess.TimeoutExpired):
                service.process.wait(max(0.0, deadline - time.monotonic()))

    def _end_strays(self, all_of_them: bool = False) -> None:
        """Kill processes that a service left behind: they are this process's children now. Or everything."""
        kept = (
            set() if all_of_them else {s.process.pid for s in self._services if s.starts and s.process.poll() is None}
        )
        for child in psutil.Process().children():
            if child.pid in kept:
                continue
            with suppress(psutil.NoSuchProcess):
                for process in (*child.children(recursive=True), child):
                    with suppress(psutil.NoSuchProcess):
                        process.kill()
                child.wait(5)
