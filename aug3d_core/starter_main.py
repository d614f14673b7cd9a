"""Fork stages' processes from one that has the common libraries in memory: `python -m aug3d_core.starter_main`.

Importing them takes longer than many a stage. An order a line comes by stdin; the answers on stdout, a line each, are the
number of the process that was forked, and later how it ended. Nothing of aug3d itself is imported before the fork, so
that each stage runs the code that is there when it begins. The end of stdin is the end of the factory: then of all.
"""

from __future__ import annotations

import atexit
import gc
import importlib
import json
import os
import runpy
import selectors
import signal
import sys
import traceback
from contextlib import suppress

# What most stages import. No engine: two of them in one process corrupt memory, and some start threads, which do not
# survive a fork.
COMMON = (
    "matplotlib.backends.backend_agg",
    "matplotlib.figure",
    "numpy",
    "pandas",
    "PIL.Image",
    "psutil",
    "pyarrow.parquet",
    "pydantic",
    "scipy.interpolate",
    "scipy.ndimage",
    "scipy.optimize",
    "scipy.sparse.csgraph",
    "scipy.spatial.transform",
    "skimage.measure",
    "zarr",
)


def main() -> None:
    """Fork until stdin ends."""
    for name in COMMON:
        importlib.import_module(name)
    gc.freeze()  # a collection in a forked process would write to, and so copy, all of it
    woken, wake = os.pipe()
    for end in (woken, wake):
        os.set_blocking(end, False)
    signal.signal(signal.SIGCHLD, lambda *_: None)  # ignored, it would not wake
    signal.set_wakeup_fd(wake, warn_on_full_buffer=False)
    with selectors.DefaultSelector() as selector:
        selector.register(sys.stdin, selectors.EVENT_READ)
        selector.register(woken, selectors.EVENT_READ)
        while True:
            for ready, _ in selector.select():
                if ready.fileobj == woken:
                    os.read(woken, 4096)
                    _tell_ended()
                    continue
                line = sys.stdin.buffer.readline()
                if not line:
                    return
                order = json.loads(line)
                pid = os.fork()
                if pid == 0:
                    signal.set_wakeup_fd(-1)
                    signal.signal(signal.SIGCHLD, signal.SIG_DFL)
                    selector.close()
                    os.close(woken)
                    os.close(wake)
                    code = _become(**order)
                    atexit._run_exitfuncs()
                    sys.stdout.flush()
                    os._exit(code)  # taking libraries down in order would copy all of their memory first
                with suppress(OSError):  # here as well as there: whoever is told of it may kill the group at once
                    os.setpgid(pid, pid)
                _tell(started=pid)


def _tell_ended() -> None:
    while True:
        try:
            pid, status = os.waitpid(-1, os.WNOHANG)
        except ChildProcessError:
            return
        if pid == 0:
            return
        _tell(ended=pid, returncode=os.waitstatus_to_exitcode(status))


def _tell(**answer: int) -> None:
    os.write(1, json.dumps(answer).encode() + b"\n")


def _become(package: str, job: str, log: str, environment: dict[str, str]) -> int:
    """Run `python -m package job` here, in a process group of its own, with its output in the log; return the exit code."""
    from aug3d_core.parent import die_with_parent

    die_with_parent()
    os.setpgid(0, 0)
    os.environ.clear()
    os.environ.update(environment)
    places = filter(None, environment.get("PYTHONPATH", "").split(os.pathsep))
    sys.path[1:1] = [place for place in places if place not in sys.path]
    nothing, told = os.open(os.devnull, os.O_RDONLY), os.open(log, os.O_WRONLY | os.O_APPEND | os.O_CREAT, 0o666)
    for source, end in ((nothing, 0), (told, 1), (told, 2)):
        os.dup2(source, end)
    os.close(nothing)
    os.close(told)
    sys.argv = [package, job]
    try:
        runpy.run_module(package, run_name="__main__", alter_sys=True)
    except SystemExit as ended:
        if ended.code is None or isinstance(ended.code, int):
            return ended.code or 0
        print(ended.code, file=sys.stderr)
        return 1
    except BaseException:
        traceback.print_exc()
        return 1
    return 0


if __name__ == "__main__":
    main()
