"""Whatever a stage does, the factory lives, and says what happened."""

from __future__ import annotations

import errno
import json
import os
import shutil
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from pathlib import Path

import psutil
import pytest

from aug3d_core.factory.build import build, work_of
from aug3d_core.run.errors import StageFailed, UsageError
from aug3d_core.run.files import JOB, LOG, SPENT
from aug3d_core.run.fork_server import start
from aug3d_core.run.limits import LIMIT_HOURS, LIMIT_MEMORY
from aug3d_core.run.stage import Progress, Stage
from aug3d_core.run.stage_main import Job
from aug3d_core.store import layout
from aug3d_core.store.record import Record
from aug3d_core.store.store import Store
from tests.tests_support import FakeConfig, fake_stage, fill, wait_until_dead


@pytest.fixture(autouse=True)
def fake_package(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setenv("PYTHONPATH", str(tmp_path))


def make(store: Store, stage: Stage, config: FakeConfig, progress: Progress = lambda *_: None) -> Record:
    return build(store, work_of(stage, config, {}), progress).record


def run(tmp_path: Path, do: str, **changes: object) -> Record:
    return make(Store(tmp_path / "home"), fake_stage(tmp_path, **changes), FakeConfig(do=do))


def fail(tmp_path: Path, do: str, **changes: object) -> StageFailed:
    with pytest.raises(StageFailed) as caught:
        run(tmp_path, do, **changes)
    return caught.value


def test_a_good_stage_leaves_a_record_with_its_cost(tmp_path: Path) -> None:
    record = run(tmp_path, "work")
    assert record.metrics["figure"] == 1.5
    assert record.seconds > 0 and record.peak_mib > 5
    assert record.cpu_seconds is not None and 0.2 < record.cpu_seconds < 10 * record.seconds
    assert set(record.files) == {"half"}
    assert record.series["curve"] == ((0, 1.0), (1, 2.0))


def test_it_is_not_made_twice(tmp_path: Path) -> None:
    first = run(tmp_path, "succeed")
    started = time.monotonic()
    assert run(tmp_path, "succeed") == first
    assert time.monotonic() - started < 0.5


def test_two_at_once_make_it_once(tmp_path: Path) -> None:
    records, stage = list[Record](), fake_stage(tmp_path)  # written once: its code must not change while it is made

    def make_it() -> None:
        records.append(make(Store(tmp_path / "home"), stage, FakeConfig(do="slow")))

    threads = [threading.Thread(target=make_it) for _ in range(2)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    log = tmp_path / "home" / layout.OBJECTS / "fake" / records[0].key / LOG
    assert records[0] == records[1]
    assert log.read_text().count("the log says slow") == 1


def test_what_new_code_makes_does_not_get_the_key_of_the_old(tmp_path: Path) -> None:
    store, stage, caught = Store(tmp_path / "home"), fake_stage(tmp_path), []
    key = work_of(stage, FakeConfig(), {}).key

    def wait() -> None:
        with pytest.raises(StageFailed) as failure:
            make(store, stage, FakeConfig())
        caught.append(failure.value)

    waiting = threading.Thread(target=wait)
    with store.lock(stage.name, key):
        waiting.start()
        time.sleep(0.5)  # it has the key, and waits for the lock
        source = tmp_path / "tests_fake" / "stage.py"
        source.write_text(source.read_text().replace("1.5", "2.5"))
    waiting.join()
    assert "changed after this run began" in caught[0].problem and caught[0].remedy == "run again"
    assert store.find(stage.name, key) is None
    assert make(store, stage, FakeConfig()).key != key


def test_an_error_for_people_comes_through_with_log_and_replay(tmp_path: Path) -> None:
    failure = fail(tmp_path, "raise")
    assert failure.cause == "refused"
    assert "photo a.jpg is torn" in failure.problem
    assert failure.remedy == "mend a.jpg"
    assert "the log says raise" in failure.log_tail


def test_the_replay_command_repeats_the_failure(tmp_path: Path) -> None:
    failure = fail(tmp_path, "raise")
    done = subprocess.run(failure.replay.split(), capture_output=True, text=True)
    assert done.returncode == 1
    assert "photo a.jpg is torn" in done.stderr


@pytest.mark.parametrize(
    ("do", "cause", "words"),
    [("segfault", "crash", "SIGSEGV"), ("vanish", "error", "no result")],
)
def test_native_ends_become_typed_errors(tmp_path: Path, do: str, cause: str, words: str) -> None:
    failure = fail(tmp_path, do)
    assert failure.cause == cause
    assert words in failure.problem


def test_a_stage_that_hangs_is_killed_with_its_workers(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(LIMIT_HOURS, str(6 / 3600))
    failure = fail(tmp_path, "hang", resumable=True)
    assert failure.cause == "timeout" and "6 s" in failure.problem and f"set {LIMIT_HOURS} higher" in failure.remedy
    for name in ("pid", "worker_pid"):
        wait_until_dead(wait_for_pid(tmp_path, name))


def test_a_stage_that_eats_memory_is_killed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(LIMIT_MEMORY, str(150 / 1024))
    failure = fail(tmp_path, "memory")
    assert failure.cause == "memory"
    assert "150 MiB" in failure.problem and f"set {LIMIT_MEMORY} higher" in failure.remedy


def test_memory_that_processes_share_counts_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(LIMIT_MEMORY, "0.6")
    assert 300 < run(tmp_path, "share").peak_mib < 500, "300 MiB, shared by four"


def test_a_changed_limit_computes_nothing_again(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    first = run(tmp_path, "succeed")
    monkeypatch.setenv(LIMIT_MEMORY, "1")
    monkeypatch.setenv(LIMIT_HOURS, "1")
    assert run(tmp_path, "succeed") == first


def test_a_wrong_limit_starts_no_stage(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(LIMIT_HOURS, "for ever")
    with pytest.raises(UsageError, match=LIMIT_HOURS):
        run(tmp_path, "succeed")


# The interrupt may come while psutil has a file of /proc open, which nobody closes then.
@pytest.mark.filterwarnings("ignore:Exception ignored in:pytest.PytestUnraisableExceptionWarning")
def test_a_run_that_is_cancelled_ends_its_stage(tmp_path: Path) -> None:
    """Prefect cancels by an exception in the thread that waits, as Ctrl-C does."""
    pids: list[int] = []

    def cancel() -> None:
        pids.extend(wait_for_pid(tmp_path, name) for name in ("pid", "worker_pid"))
        assert psutil.Process(pids[0]).name() == "aug3d fake"
        signal.pthread_kill(threading.main_thread().ident or 0, signal.SIGINT)

    heard = signal.signal(signal.SIGINT, signal.default_int_handler)
    canceller = threading.Thread(target=cancel)
    canceller.start()
    try:
        with pytest.raises(KeyboardInterrupt):
            run(tmp_path, "hang")
    finally:
        signal.signal(signal.SIGINT, heard)
    for pid in pids:
        wait_until_dead(pid)


def test_a_listener_that_fails_does_not_end_the_stage(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    def refuse(*_: object) -> None:
        raise ConnectionError("the server said 500")

    stage = fake_stage(tmp_path)
    assert make(Store(tmp_path / "home"), stage, FakeConfig(), refuse).metrics["figure"] == 1.5
    assert "the server said 500" in caplog.text


def test_a_listener_that_sleeps_does_not_hold_up_the_watch(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(LIMIT_HOURS, str(2 / 3600))
    stage, woken = fake_stage(tmp_path), threading.Event()
    started = time.monotonic()

    def sleep(*_: object) -> None:
        woken.wait(60)

    with pytest.raises(StageFailed) as caught:
        make(Store(tmp_path / "home"), stage, FakeConfig(do="hang"), sleep)
    woken.set()
    assert caught.value.cause == "timeout" and time.monotonic() - started < 30


def test_a_killed_stage_resumes_and_a_plain_one_starts_afresh(tmp_path: Path) -> None:
    store = Store(tmp_path / "home")
    for resumable in (True, False):
        stage = fake_stage(tmp_path, resumable=resumable)
        config = FakeConfig(do="slow")
        caught: list[BaseException] = []

        def kill_me(stage=stage, config=config, caught=caught) -> None:
            try:
                make(store, stage, config)
            except StageFailed as failure:
                caught.append(failure)

        thread = threading.Thread(target=kill_me)
        thread.start()
        os.kill(wait_for_pid(tmp_path, "pid"), signal.SIGKILL)
        thread.join()
        assert caught[0].cause == "killed"  # type: ignore[attr-defined]
        record = make(store, stage, config)
        assert record.metrics["resumed"] is resumable
        next((tmp_path / "home" / layout.OBJECTS / "fake").iterdir()).rename(tmp_path / f"away{resumable}")


@pytest.mark.parametrize("resumable", [True, False])
def test_what_killed_tries_cost_is_told_if_the_next_goes_on_with_it(tmp_path: Path, resumable: bool) -> None:
    thread = threading.Thread(target=fail, args=(tmp_path, "slow"), kwargs={"resumable": resumable})
    thread.start()
    pid = wait_for_pid(tmp_path, "pid")
    [spent] = wait_for(lambda: list((tmp_path / "home" / layout.WORK).glob(f"fake/*/{SPENT}")))
    told = json.loads(spent.read_bytes())
    assert 1 < told["seconds"] < 100 and told["cpu_seconds"] > 0 and told["peak_mib"] > 5
    os.kill(pid, signal.SIGKILL)
    thread.join()
    if resumable:
        spent.write_text(json.dumps({"seconds": 1000.0, "cpu_seconds": 500.0, "peak_mib": 9000.0}))
    record = run(tmp_path, "slow", resumable=resumable)
    assert record.cpu_seconds is not None
    assert {record.seconds > 1000, record.cpu_seconds > 500, record.peak_mib == 9000} == {resumable}
    assert not list((tmp_path / "home" / layout.OBJECTS).glob(f"fake/*/{SPENT}*"))


@pytest.mark.parametrize("torn", ["", "[1]", '{"seconds": 1}'])
def test_a_torn_note_of_what_was_spent_is_no_obstacle(tmp_path: Path, torn: str) -> None:
    stage, store = fake_stage(tmp_path, resumable=True), Store(tmp_path / "home")
    work = store.work_dir("fake", work_of(stage, FakeConfig(), {}).key)
    work.mkdir(parents=True)
    (work / SPENT).write_text(torn)
    assert make(store, stage, FakeConfig()).seconds < 100


def test_the_death_of_the_fork_server_is_an_end_from_outside(tmp_path: Path) -> None:
    """Such an end is tried again."""

    def kill() -> None:
        server = psutil.Process(wait_for_pid(tmp_path, "pid")).parent()
        assert server is not None
        server.kill()

    killing = threading.Thread(target=kill)
    killing.start()
    assert fail(tmp_path, "slow").cause == "killed"
    killing.join()
    assert run(tmp_path, "slow").metrics["figure"] == 1.5


def test_killing_the_factory_kills_its_stages(tmp_path: Path) -> None:
    fake_stage(tmp_path)
    code = f"""
from pathlib import Path
from aug3d_core.factory.build import build, work_of
from aug3d_core.run.fork_server import PRELOAD
from aug3d_core.store.store import Store
from aug3d_core.run.stage import Stage
from tests_fake.config import FakeConfig
PRELOAD.clear()
work = work_of(Stage("fake", FakeConfig, (), "tests_fake.stage:run", (), "figure"), FakeConfig(do="hang"), {{}})
build(Store(Path({str(tmp_path / "home")!r})), work, lambda *_: None)
"""
    with subprocess.Popen([sys.executable, "-c", code]) as factory:
        try:
            stage_pid = wait_for_pid(tmp_path, "pid")
        finally:
            factory.kill()
    wait_until_dead(stage_pid)


@pytest.mark.parametrize("do", ["raise", "succeed"])
def test_a_stage_that_can_write_nothing_says_so_by_its_exit_code(
    tmp_path: Path, small_disk: Callable[[int], Path], do: str
) -> None:
    stage, folder = fake_stage(tmp_path), small_disk(1)
    job = Job(stage=stage.name, entry=stage.entry, config={"do": do}, inputs={})
    (folder / JOB).write_text(job.model_dump_json())
    fill(folder / "else")
    assert start(stage.package, folder / JOB, folder / LOG, os.environ).wait() == errno.ENOSPC


@pytest.mark.parametrize("resumable", [False, True])
def test_a_full_disk_is_named_and_loses_nothing(
    tmp_path: Path, small_disk: Callable[[int], Path], resumable: bool
) -> None:
    store = Store(small_disk(24))
    stage = fake_stage(tmp_path, resumable=resumable)
    kept = make(store, stage, FakeConfig())
    with pytest.raises(StageFailed) as caught:
        make(store, stage, FakeConfig(do="fill"))
    assert caught.value.cause == "disk"
    assert "MiB free" in caught.value.remedy
    assert store.find("fake", kept.key) == kept
    if resumable:  # what it made is kept for the next try, and fills the disk
        shutil.rmtree(store.root / layout.WORK / "fake")
    else:
        assert make(store, stage, FakeConfig(do="slow")).metrics["figure"] == 1.5


@pytest.mark.parametrize("elsewhere", [True, False])
def test_a_full_disk_is_the_one_of_the_file_that_could_not_be_written(
    tmp_path: Path, small_disk: Callable[[int], Path], elsewhere: bool
) -> None:
    store, stage, other = Store(tmp_path / "home"), fake_stage(tmp_path), small_disk(1)
    file = (other if elsewhere else tmp_path) / "gone" / "0000.npz"
    source = tmp_path / "tests_fake" / "stage.py"
    raised = f'OSError({errno.ENOSPC}, "No space left on device", "{file}")'
    source.write_text(source.read_text().replace('InputError("photo a.jpg is torn", "mend a.jpg")', raised))
    with pytest.raises(StageFailed) as caught:
        make(store, stage, FakeConfig(do="raise"))
    failure = caught.value
    assert failure.cause == "disk" and str(file) in failure.problem and "MiB free" in failure.remedy
    assert f"no space left on the disk of {other if elsewhere else store.root}" in failure.problem
    assert ("TMPDIR" in failure.remedy, "--home" in failure.remedy) == (elsewhere, not elsewhere)


def wait_for(found: Callable[[], list[Path]]) -> list[Path]:
    for _ in range(1200):
        if paths := found():
            return paths
        time.sleep(0.05)
    raise AssertionError("it did not come to be")


def wait_for_pid(tmp_path: Path, name: str) -> int:
    for _ in range(1200):
        for found in (tmp_path / "home" / layout.WORK).glob(f"fake/*/{name}"):
            if text := found.read_text():
                found.unlink()
                return int(text)
        time.sleep(0.05)
    raise AssertionError("the stage did not start")
