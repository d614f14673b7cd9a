"""Engines that must not meet are never in one process, each test is run once, and tests of one scene stay together."""

from __future__ import annotations

import subprocess
from itertools import combinations
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from tests.engine_imports import ENGINES, ROOT, engines_of, mixed
from tests.processes import KINDS, Apart, Kinds
from tests.tests_support import run_pytest


def test_no_file_needs_engines_that_must_not_meet() -> None:
    found = {file.name: mixed(engines_of(file)) for file in ROOT.glob("tests/**/test_*.py")}
    assert len(found) > 100 and not {name: pairs for name, pairs in found.items() if pairs}


def test_each_file_may_be_run_by_a_kind_of_process() -> None:
    needs = {file.name: engines_of(file) for file in ROOT.glob("tests/**/test_*.py")}
    assert not {name: engines for name, engines in needs.items() if not any(engines <= set(kind) for kind in KINDS)}


def test_what_is_imported_on_the_way_counts_and_what_only_types_need_does_not(tmp_path: Path) -> None:
    (tmp_path / "test_it.py").write_text(
        "from typing import TYPE_CHECKING\nfrom aug3d_core.geometry import raycast\nif TYPE_CHECKING:\n    import torch\n"
    )
    assert engines_of(tmp_path / "test_it.py") == {"open3d"}
    assert not engines_of(ROOT / "flows" / "cli.py")


class Process:
    """Stands in for a process of xdist: does what it is told, one test at a time."""

    def __init__(self, collected: list[str]) -> None:
        self.collected = collected
        self.told: list[int] = []
        self.done: list[str] = []
        self.shutting_down = False

    def send_runtest_some(self, indices: list[int]) -> None:
        self.told += indices

    def shutdown(self) -> None:
        self.shutting_down = True

    def step(self, scheduler: Any) -> bool:
        """Run one test, if the next is known or there is none: xdist's processes wait for that."""
        if len(self.told) < (1 if self.shutting_down else 2):
            return False
        index = self.told.pop(0)
        self.done.append(self.collected[index])
        scheduler.mark_test_complete(self, index)
        return True


@pytest.mark.parametrize("crashes", [0, 3])
@pytest.mark.parametrize("seed", range(20))
def test_each_test_is_run_once_by_a_process_that_collected_it(seed: int, crashes: int) -> None:
    """The test that ends its process is not run again; all others are, also those of the same file."""
    rng = np.random.default_rng(seed)
    files = {f"tests/x/test_{i}.py": int(rng.integers(1, 6)) for i in range(int(rng.integers(1, 15)))}
    files |= {"tests/journeys/test_demo.py": 3, "tests/journeys/test_study.py": 2}
    tests = {file: [f"{file}::test_{i}" for i in range(count)] for file, count in files.items()}
    kinds = {file: int(rng.integers(3)) for file in tests}  # 0 and 1: only for that kind of process, 2: for both
    kinds["tests/journeys/test_demo.py"] = kinds["tests/journeys/test_study.py"] = 2
    collected = [[test for file in tests if kinds[file] in (kind, 2) for test in tests[file]] for kind in (0, 1)]
    processes = [Process(collected[kind]) for kind in (0, 1, 0, 1)]
    session = SimpleNamespace(testscollected=0)
    manager = SimpleNamespace(getplugin=lambda _: SimpleNamespace(_session=session))
    scheduler: Any = Apart(SimpleNamespace(getvalue=lambda _: ["4*popen"], pluginmanager=manager))  # type: ignore[arg-type]
    for process in processes:
        scheduler.add_node(process)
    for process in processes:
        scheduler.add_node_collection(process, process.collected)
    scheduler.schedule()
    crashed: list[str] = []
    dead: list[Process] = []
    while any([process.step(scheduler) for process in rng.permutation(np.array(processes, object))]):
        able = [process for process in processes if process.told]
        if len(crashed) < crashes and able and rng.random() < 0.2:
            process = able[int(rng.integers(len(able)))]
            assert scheduler.remove_node(process) == process.collected[process.told[0]]
            crashed.append(process.collected[process.told[0]])
            processes.remove(process)
            dead.append(process)
            processes.append(Process(process.collected))
            scheduler.add_node(processes[-1])
            scheduler.add_node_collection(processes[-1], process.collected)
            scheduler.schedule()
    assert all(process.shutting_down and not process.told for process in processes)
    done = [test for process in (*processes, *dead) for test in process.done]
    assert sorted(done + crashed) == sorted(test for file in tests.values() for test in file)
    assert session.testscollected == len(done) + len(crashed)
    for process in processes:
        assert set(process.done) <= set(process.collected)
        journeys = [test for test in process.done if "journeys" in test]
        assert crashes or len(journeys) in (0, 5), "they share a scene"


def test_a_process_that_replaces_a_crashed_one_is_of_its_kind() -> None:
    kinds = Kinds()

    def start(name: str) -> Any:
        config = SimpleNamespace(option=SimpleNamespace(tx=["popen"] * 2))
        node: Any = SimpleNamespace(config=config, gateway=SimpleNamespace(id=name), workerinput={})
        kinds.pytest_configure_node(node)
        return node

    first, second = start("gw0"), start("gw1")
    assert not set(first.workerinput["engines"]) & set(second.workerinput["engines"])
    kinds.pytest_testnodedown(first, "crashed")
    assert start("gw2").workerinput == first.workerinput
    for kind in (first, second):
        assert not mixed(kind.workerinput["engines"])


def run(folder: Path, *options: str, **files: str) -> subprocess.CompletedProcess[str]:
    """Run test files in which engines are empty modules."""
    for engine in ENGINES:
        (folder / f"{engine}.py").touch()
    for name, text in files.items():
        (folder / f"{name}.py").write_text(text)
    return run_pytest(folder, "tests.processes", *options)


IN_TORCH = "import sys, torch\ndef test_it(): assert 'open3d' not in sys.modules\n"
IN_OPEN3D = "import sys, open3d\ndef test_it(): assert 'torch' not in sys.modules\n"


def test_files_that_must_not_meet_are_run_apart_or_not_at_all(tmp_path: Path) -> None:
    files = {"test_a": IN_TORCH, "test_b": IN_OPEN3D, "test_c": "def test_it(): pass\n"}
    apart = run(tmp_path, "-n", "2", **files)
    assert apart.returncode == 0 and "3 passed" in apart.stdout, apart.stdout
    alone = run(tmp_path, "-n", "2", "test_a.py", "test_c.py::test_it")
    assert alone.returncode == 0 and "2 passed" in alone.stdout, alone.stdout
    together = run(tmp_path, "-n", "0")
    assert together.returncode != 0
    assert "test_b.py would bring open3d and torch into one process (test_a.py)" in together.stdout + together.stderr


ALLOWED = [{"cv2", "torch"}, {"cv2", "open3d"}, {"open3d", "pycolmap"}]


def test_a_pair_may_meet_or_is_named() -> None:
    for pair in combinations(ENGINES, 2):
        assert mixed(pair) == (set() if set(pair) in ALLOWED else {" and ".join(pair)})


@pytest.mark.parametrize(("pair", "code"), [(("open3d", "torch"), 1), (("cv2", "torch"), 0)])
def test_engines_that_meet_while_testing_fail_the_run(pair: tuple[str, str], code: int, tmp_path: Path) -> None:
    tells = "".join(f"    import {engine}\n" for engine in pair) if code == 0 else ""
    load = "".join(f"    __import__({engine!r})\n" for engine in pair)
    done = run(tmp_path, "-n", "0", test_it=f"def test_it():\n{tells}{load}")
    assert done.returncode == code, done.stdout
    assert ("open3d and torch are in one process" in done.stdout) == (code == 1)


@pytest.mark.parametrize("told", [False, True])
def test_an_engine_that_a_file_loads_without_telling_fails_the_run(told: bool, tmp_path: Path) -> None:
    """Though it meets no other: in another process it would."""
    tells = "def tells():\n    import cv2\n" if told else ""
    done = run(tmp_path, "-n", "0", test_it=f"{tells}def test_it():\n    __import__('cv2')\n")
    assert done.returncode == (0 if told else 1), done.stdout
    assert ("cv2: loaded by test_it.py, which does not import it" in done.stdout) != told


# The signal of pytest-timeout is raised, and swallowed or too late for the fixture
SWALLOWED = """
    while True:
        try:
            time.sleep(60)
        except BaseException:
            pass
"""
HUNG = {
    "test_call": f"def test_hung():{SWALLOWED}",
    "test_end": f"@pytest.fixture\ndef ends():\n    yield{SWALLOWED}\ndef test_hung(ends): assert False\n",
}


@pytest.mark.parametrize("name", HUNG)
def test_what_nothing_else_ends_is_ended_and_named(name: str, tmp_path: Path) -> None:
    (tmp_path / "early.py").write_text("from tests import processes\nprocesses._GRACE_S = 1\n")
    files = {name: "import pytest\nimport time\n" + HUNG[name], "test_other": "def test_it(): pass\n"}
    done = run(tmp_path, "-p", "timeout", "-p", "early", "-n", "2", "-o", "timeout=1", **files)
    assert done.returncode == 1 and "1 passed" in done.stdout, done.stdout
    assert f"{name}.py::test_hung" in done.stdout and "Timeout (0:00:0" in done.stderr and f"{name}.py" in done.stderr
