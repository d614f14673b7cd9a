"""A stage that does what a test asks, in a real process of its own: succeed, raise, crash, hang, eat memory."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import textwrap
import time
from contextlib import suppress
from pathlib import Path

import psutil

from aug3d_core.run.stage import Stage, StageConfig

_RUN = """
    import os, signal, subprocess, sys, time
    from aug3d_core.run.errors import InputError
    from aug3d_core.run.stage import Outcome
    from tests_fake.config import FakeConfig

    def run(inputs, config: FakeConfig, out, progress):
        print("the log says", config.do)
        resumed = (out / "half").exists()
        (out / "half").write_text("x")
        progress(1, 2, config.do)
        (out.parent / "pid").write_text(str(os.getpid()))
        if config.do == "raise":
            raise InputError("photo a.jpg is torn", "mend a.jpg")
        if config.do == "segfault":
            os.kill(os.getpid(), signal.SIGSEGV)
        if config.do == "vanish":
            os._exit(0)
        if config.do == "hang":
            worker = subprocess.Popen([sys.executable, "-c", "import time; time.sleep(600)"])
            (out.parent / "worker_pid").write_text(str(worker.pid))
            signal.signal(signal.SIGTERM, signal.SIG_IGN)
            time.sleep(600)
        if config.do == "slow":
            time.sleep(2)
        if config.do == "work":  # processor time is told in hundredths
            while time.process_time() < 0.5:
                pass
        if config.do == "memory":
            hoard = bytearray(300 * 2**20)
            hoard[::4096] = b"1" * len(hoard[::4096])
            time.sleep(600)
        if config.do == "share":
            hoard = bytearray(300 * 2**20)
            hoard[::4096] = b"1" * len(hoard[::4096])
            for _ in range(3):
                if os.fork() == 0:
                    time.sleep(3)
                    os._exit(0)
            time.sleep(3)
        if config.do == "fill":
            with open(out / "big", "wb") as file:
                while True:
                    file.write(bytes(2**20))
                    file.flush()
        (out / "half").write_text("done")
        return Outcome(metrics={"figure": 1.5, "resumed": resumed}, series={"curve": ((0, 1.0), (1, 2.0))})
"""
_MAIN = """
    from aug3d_core.run.stage_main import main
    main()
"""
_CONFIG = """
    from aug3d_core.run.stage import StageConfig

    class FakeConfig(StageConfig):
        do: str = "succeed"
"""


class FakeConfig(StageConfig):
    """Says what the fake stage shall do."""

    do: str = "succeed"


def fake_stage(folder: Path, **changes: object) -> Stage:
    """Write the package `tests_fake` into a folder, which must be on PYTHONPATH, and return its stage."""
    package = folder / "tests_fake"
    package.mkdir(exist_ok=True)
    for name, text in {"__init__": "", "stage": _RUN, "__main__": _MAIN, "config": _CONFIG}.items():
        (package / f"{name}.py").write_text(textwrap.dedent(text))
    return Stage("fake", FakeConfig, (), "tests_fake.stage:run", (), "figure", **changes)  # type: ignore[arg-type]


def hear_signals() -> None:
    """Let a child hear Ctrl-C and the end of its terminal, though the tests were begun in the background, deaf to both."""
    for number in (signal.SIGINT, signal.SIGHUP):
        signal.signal(number, signal.SIG_DFL)


def run_pytest(folder: Path, plugin: str, *words: str) -> subprocess.CompletedProcess[str]:
    """Run the tests of a folder with one of this project's plugins and xdist; no other, since some take seconds to load."""
    given = {name: value for name, value in os.environ.items() if not name.startswith("PYTEST_")}
    path = os.pathsep.join([str(folder), str(Path(__file__).parents[1])])
    return subprocess.run(
        [sys.executable, "-m", "pytest", "-p", "xdist.plugin", "-p", plugin, "-p", "no:cacheprovider", *words],
        cwd=folder,
        capture_output=True,
        text=True,
        env=given | {"PYTEST_DISABLE_PLUGIN_AUTOLOAD": "1", "PYTHONPATH": path},
    )


def words_of(process: psutil.Process) -> list[str]:
    """Return the command line of a process; nothing of one that has ended, be it a moment ago."""
    try:
        return process.cmdline()
    except psutil.Error:
        return []


def wait_until_dead(pid: int) -> None:
    """Wait for a process to end, or fail after half a minute."""
    for _ in range(600):
        if not psutil.pid_exists(pid) or psutil.Process(pid).status() == psutil.STATUS_ZOMBIE:
            return
        time.sleep(0.05)
    raise AssertionError(f"process {pid} lives on")


def rot(file: Path, content: bytes) -> None:
    """Replace what is in a file as a disk does that lost bits: size and time stay."""
    stat = file.stat()
    file.write_bytes(content)
    os.utime(file, ns=(stat.st_atime_ns, stat.st_mtime_ns))


def flip(file: Path, bit: int | None = None) -> None:
    """Change one bit of a file as a disk does; None for one in the middle."""
    content = bytearray(file.read_bytes())
    at = 4 * len(content) if bit is None else bit
    content[at // 8] ^= 1 << (at % 8)
    rot(file, bytes(content))


def fill(file: Path) -> None:
    """Take what is free on a disk: in pieces of a size while there is room for one, then in smaller ones."""
    with suppress(OSError), file.open("ab", buffering=0) as other:
        for size in (1 << 26, 1 << 20, 1 << 12):
            with suppress(OSError):
                while True:
                    os.posix_fallocate(other.fileno(), other.tell(), size)
                    other.seek(size, os.SEEK_CUR)
