"""Which process runs which tests: engines that must not meet stay apart, and tests that share a scene stay together.

A pytest plugin. Processes are of two kinds, by the engines that they may load; each collects only the files that it may run.
"""

from __future__ import annotations

import faulthandler
import os
import sys
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from threadpoolctl import threadpool_limits
from xdist.remote import Producer
from xdist.scheduler import LoadScopeScheduling
from xdist.workermanage import WorkerController

from tests.engine_imports import ENGINES, engines_of, mixed

KINDS = (("open3d", "pycolmap"), ("cv2", "torch"))
_SLOW = ("engines", "journeys", "tasks")  # folders: real engines, whole journeys, real servers
_PROGRAMS = ("attack", "flows", "infra", "journeys", "tasks")  # folders whose tests start programs of several processes
_GRACE_S = 120  # for what a test's fixtures do to end, after its time is up
_LONGEST_FIRST = (
    "tests/attack/test_kills", "tests/attack/test_full_disk.py", "tests/attack/test_workers.py",
    "tests/journeys/test_demo.py", "tests/journeys/test_daily_use.py", "tests/journeys/test_workers.py", "tests/infra",
    "tests/engines", "tests/flows", "tests/tasks",
)  # fmt: skip
# Files of one home: what the first of them makes, the others use.
_TOGETHER = {
    "tests/journeys/test_study.py": "tests/journeys/test_demo.py",
    "tests/journeys/test_bad_input.py": "tests/journeys/test_daily_use.py",
    "tests/journeys/test_import.py": "tests/journeys/test_daily_use.py",
}


class Apart(LoadScopeScheduling):
    """Gives a file's tests to one process, and to none that has not collected them.

    xdist's own groups have no effect in pytest 9.2, which no longer lets a test's id be changed.
    """

    def _split_scope(self, nodeid: str) -> str:
        file = nodeid.partition("::")[0]
        return _TOGETHER.get(file, file)

    def add_node_collection(self, node: WorkerController, collection: list[str]) -> None:
        """Take what a process collected; one that replaces a crashed one has collected the same."""
        self.registered_collections[node] = list(collection)

    def remove_node(self, node: WorkerController) -> str | None:
        """Give what a process that ended left undone to others, but for the test that ended it, which is returned.

        xdist's own runs that one again, and hands out files of which nothing is left: a process that gets such a one waits
        for ever.
        """
        work = self.assigned_work.pop(node)
        ended_by = next((test for unit in work.values() for test, done in unit.items() if not done), None)
        if ended_by is None:
            return None
        work[self._split_scope(ended_by)][ended_by] = True
        self.workqueue.update({scope: unit for scope, unit in work.items() if not all(unit.values())})
        for other in self.nodes:
            self._reschedule(other)
        return ended_by

    def schedule(self) -> None:
        """Share out the tests of all processes, the longest first."""
        if self.collection is None:
            collected = dict.fromkeys(test for tests in self.registered_collections.values() for test in tests)
            self.collection = sorted(collected, key=lambda nodeid: _rank(self._split_scope(nodeid)))
            for nodeid in self.collection:
                self.workqueue.setdefault(self._split_scope(nodeid), {})[nodeid] = False
            # xdist tells pytest what the last process has collected
            self.config.pluginmanager.getplugin("dsession")._session.testscollected = len(self.collection)
        for _ in range(2):  # a process begins a test when it knows the next one
            for node in self.nodes:
                self._reschedule(node)

    def _reschedule(self, node: WorkerController) -> None:
        if node.shutting_down or node not in self.registered_collections:
            return
        scope = self._next_for(node)
        if scope is None:
            node.shutdown()
        elif self._pending_of(self.assigned_work[node]) <= 2:
            self.workqueue.move_to_end(scope, last=False)
            self._assign_work_unit(node)

    def _next_for(self, node: WorkerController) -> str | None:
        able = set(self.registered_collections[node])
        return next((scope for scope, unit in self.workqueue.items() if able.issuperset(unit)), None)


def _rank(scope: str) -> int:
    return next((i for i, begins in enumerate(_LONGEST_FIRST) if scope.startswith(begins)), len(_LONGEST_FIRST))


class Kinds:
    """The controller's list of what kind its processes are; one that replaces a crashed one is of the same kind."""

    def __init__(self) -> None:
        self._of: dict[str, tuple[str, ...]] = {}

    def pytest_configure_node(self, node: WorkerController) -> None:
        """Tell a process which engines it may load; any, if it is the only one."""
        if len(node.config.option.tx) > 1:
            there = Counter(self._of.values())
            self._of[node.gateway.id] = min(KINDS, key=lambda kind: there[kind])
            node.workerinput["engines"] = self._of[node.gateway.id]

    def pytest_testnodedown(self, node: WorkerController, error: object) -> None:
        """Forget a process that has ended."""
        self._of.pop(node.gateway.id, None)


class Collecting:
    """A process's own choice of files, made before any is imported: importing a test file loads its engines."""

    def __init__(self, config: pytest.Config) -> None:
        given: dict[str, Any] = getattr(config, "workerinput", {})
        self._may = given.get("engines")
        self._loads: dict[str, Path] = {}
        if self._may:  # a file that is named is not left out silently, so its name is taken back
            config.args[:] = [arg for arg in config.args if not self._foreign(_file(config, arg))]

    def pytest_ignore_collect(self, collection_path: Path, config: pytest.Config) -> bool | None:
        """Leave out what this process may not load, and whole folders of slow tests where these are not wanted."""
        slow = collection_path.name in _SLOW and config.option.markexpr == "not slow"
        return True if slow or self._foreign(collection_path) else None

    @pytest.hookimpl(tryfirst=True)
    def pytest_make_collect_report(self, collector: pytest.Collector) -> None:
        """Stop before a file is imported that would bring the wrong engines together, where no other process may take it."""
        if isinstance(collector, pytest.Module) and not self._may:
            self._check(collector.path)

    def _foreign(self, file: Path) -> bool:
        return bool(self._may) and _is_test(file) and not engines_of(file) <= set(self._may)

    def _check(self, file: Path) -> None:
        engines = engines_of(file)
        if pairs := mixed(engines) or mixed({*engines, *self._loads}):
            others = {path.name for engine, path in self._loads.items() if engine in " ".join(pairs)}
            pytest.exit(
                f"{file} would bring {', '.join(sorted(pairs))} into one process ({', '.join(sorted(others))}): "
                "run these tests with -n 2, or one file at a time",
                returncode=pytest.ExitCode.USAGE_ERROR,
            )
        self._loads |= dict.fromkeys(engines, file)


class OneCore:
    """Keeps each process to a core, but for the tests of whole programs.

    A small network on the threads of two cores that others use too takes three times as long as on one core: its threads wait
    for each other.
    """

    def __init__(self, config: pytest.Config) -> None:
        self._all = os.sched_getaffinity(0)
        cores = sorted(self._all)
        number = int(config.workerinput["workerid"].removeprefix("gw"))  # type: ignore[attr-defined]
        self._own = {cores[(number + number // len(KINDS)) % len(cores)]}  # those of one kind are on different cores
        os.sched_setaffinity(0, self._own)  # libraries count the cores when they are imported
        threadpool_limits(1)  # NumPy was imported by a plugin, before: its two threads would spin on one core

    @pytest.hookimpl(tryfirst=True)
    def pytest_runtest_setup(self, item: pytest.Item) -> None:
        """Give programs all cores, and all else one."""
        os.sched_setaffinity(0, self._all if item.path.parent.name in _PROGRAMS else self._own)


class Ended:
    """Ends the process of a test whose time was up long ago, and prints where its threads are; its tests go on in another one.

    pytest-timeout ends a test by an error, once: not in C code, not where the error is swallowed, and not the fixtures of a
    test that has failed.
    """

    def __init__(self, config: pytest.Config) -> None:
        self._stderr = os.dup(2)  # what pytest does not capture
        self._limit_s = float(config.getini("timeout"))

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_protocol(self, item: pytest.Item) -> Iterator[None]:
        """Begin to count."""
        mark = item.get_closest_marker("timeout")
        self._end_in((mark.args[0] if mark else self._limit_s) + _GRACE_S)
        try:
            return (yield)
        finally:
            faulthandler.cancel_dump_traceback_later()

    @pytest.hookimpl(trylast=True)
    def pytest_exception_interact(self) -> None:
        """Count on: pytest has just stopped it, for the sake of debuggers."""
        self._end_in(_GRACE_S)

    def _end_in(self, seconds: float) -> None:
        faulthandler.dump_traceback_later(seconds, exit=True, file=self._stderr)


def _is_test(path: Path) -> bool:
    return path.suffix == ".py" and path.name.startswith("test_")


def _file(config: pytest.Config, argument: str) -> Path:
    return config.invocation_params.dir / argument.partition("::")[0]


def pytest_configure(config: pytest.Config) -> None:
    """Choose files in each process that collects; the controller of several does not."""
    config.pluginmanager.register(Collecting(config), "collecting")
    config.pluginmanager.register(Kinds(), "kinds")
    if config.pluginmanager.hasplugin("timeout"):
        config.pluginmanager.register(Ended(config), "ended")
    if hasattr(config, "workerinput"):
        config.pluginmanager.register(OneCore(config), "one core")


def pytest_xdist_auto_num_workers() -> int:
    """Use two processes more than cores, since some wait for servers and leases: on two cores each has both kinds."""
    return 2 + len(os.sched_getaffinity(0))


def pytest_xdist_make_scheduler(config: pytest.Config, log: Producer) -> Apart:
    """Say how tests are shared among processes."""
    return Apart(config, log)


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Mark what the quick tests leave out."""
    for item in items:
        if item.path.parent.name in _SLOW:
            item.add_marker("slow")


@pytest.fixture(scope="session")
def mixed_so_far() -> set[str]:
    """Return the pairs of engines that have been found in this process."""
    return set()


@pytest.fixture(scope="module", autouse=True)
def engines_are_told(request: pytest.FixtureRequest, mixed_so_far: set[str]) -> Iterator[None]:
    """Fail where engines meet that corrupt each other's memory, and where a test file brings in one that it does not tell.

    Such a file could be given to a process of others, so that chance decided whether they meet. A function of the code may
    import an engine when it is called: the test file then imports that engine, or its module.
    """
    before = set(sys.modules)
    yield
    found = mixed(sys.modules) - mixed_so_far
    mixed_so_far |= found
    assert not found, f"{', '.join(sorted(found))} are in one process: run one of them in a process of its own"
    untold = set(ENGINES) & (set(sys.modules) - before) - engines_of(request.path)
    assert not untold, f"{', '.join(sorted(untold))}: loaded by {request.path.name}, which does not import it"
