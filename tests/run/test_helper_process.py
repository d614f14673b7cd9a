"""How a worker is started, followed and buried: a little module of its own, and shell scripts that stand in for it."""

import errno
import os
import textwrap
from pathlib import Path

import pytest

from aug3d_core.run import helper_process as worker
from aug3d_core.run import stage_main
from aug3d_core.run.helper_process import WorkerDied, run_worker
from aug3d_core.run.stage import Frozen

_WORKER = """
    import os
    from aug3d_core.run.helper_process import begin
    from test_worker_job import LittleJob

    job, report = begin(LittleJob)
    print("an engine is talkative")
    os.system("echo its library too")
    for i in range(job.count):
        report(f"done {i}")
"""
_JOB = """
    from aug3d_core.run.stage import Frozen

    class LittleJob(Frozen):
        count: int
"""


class LittleJob(Frozen):
    """How many lines to report."""

    count: int


def run(told: list[str] | None = None, module: str = "nothing") -> None:
    on_report = (told if told is not None else []).append
    run_worker(module, LittleJob(count=2), on_report, "the little worker", "carry less")


@pytest.fixture
def pretend(tmp_path, monkeypatch):
    """Run a shell script in place of the worker."""

    def script(text: str) -> None:
        shell: Path = tmp_path / "python"
        shell.write_text(f"#!/bin/sh\n{text}\n")
        shell.chmod(0o755)
        monkeypatch.setattr(worker.sys, "executable", str(shell))

    return script


def test_a_worker_reads_its_job_and_only_its_reports_come_back(tmp_path, monkeypatch):
    (tmp_path / "test_worker_little.py").write_text(textwrap.dedent(_WORKER))
    (tmp_path / "test_worker_job.py").write_text(textwrap.dedent(_JOB))
    monkeypatch.setenv("PYTHONPATH", str(tmp_path))
    told: list[str] = []
    run(told, "test_worker_little")
    assert told == ["done 0", "done 1"]


def test_the_worker_stays_in_the_process_group_that_is_killed_with_the_stage(pretend):
    pretend("ps -o pgid= -p $$")
    told: list[str] = []
    run(told)
    assert [int(line) for line in told] == [os.getpgrp()]


def test_it_has_this_processs_environment_and_what_is_set_beside_it(pretend, monkeypatch):
    pretend('echo "$HERE $THERE"')
    monkeypatch.setenv("HERE", "as it is")
    monkeypatch.setenv("THERE", "as it is")
    told: list[str] = []
    run_worker("nothing", LittleJob(count=2), told.append, "the little worker", "carry less", {"THERE": "set"})
    assert told == ["as it is set"]


def test_a_failure_is_told_with_the_last_words(pretend):
    pretend("seq 100 >&2; echo 'mesh is broken' >&2; exit 3")
    with pytest.raises(
        WorkerDied, match=r"(?s)the little worker ended with exit code 3.*\n100\nmesh is broken"
    ) as caught:
        run()
    assert "\n80\n" not in caught.value.problem


def test_a_killed_worker_is_told_with_its_signal_and_what_helps(pretend):
    pretend("echo 'no memory left' >&2; kill -KILL $$")
    with pytest.raises(WorkerDied, match=r"(?s)signal SIGKILL.*no memory left") as caught:
        run()
    assert caught.value.remedy == "It was killed, mostly for memory: carry less."


def test_a_full_disk_is_told_from_a_crash(pretend):
    pretend("echo 'OSError: [Errno 28] No space left on device' >&2; exit 1")
    with pytest.raises(OSError, match=r"No space left.*the little worker") as caught:
        run()
    assert caught.value.errno == errno.ENOSPC


def test_what_a_worker_reported_before_it_died_is_not_lost(pretend):
    pretend("echo one; exit 1")
    told: list[str] = []
    with pytest.raises(WorkerDied, match="exit code 1"):
        run(told)
    assert told == ["one"]


@pytest.mark.parametrize(("script", "cause"), [("kill -9 $$", "killed"), ("kill -6 $$", "crash"), ("exit 3", "error")])
def test_a_worker_that_was_killed_is_no_refusal_and_so_is_tried_again(pretend, script, cause):
    pretend(script)
    with pytest.raises(WorkerDied) as caught:
        run()
    assert stage_main._described(caught.value)["cause"] == cause
