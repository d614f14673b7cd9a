"""How a worker is started, followed and buried; shell scripts stand in for it."""

import os
from pathlib import Path

import pytest

from aug3d_core.rendering import launch
from aug3d_core.rendering.job import MeshFile, RenderJob
from aug3d_core.rendering.launch import WorkerDied, render


@pytest.fixture
def job(tmp_path) -> RenderJob:
    mesh = MeshFile(path=tmp_path / "mesh.ply")
    return RenderJob(meshes=(mesh,), cameras=tmp_path / "c.npz", first=0, last=2, out=tmp_path / "0.npz", samples=1)


@pytest.fixture
def pretend(tmp_path, monkeypatch):
    """Run a shell script in place of the worker."""

    def script(text: str) -> None:
        shell: Path = tmp_path / "python"
        shell.write_text(f"#!/bin/sh\n{text}\n")
        shell.chmod(0o755)
        monkeypatch.setattr(launch.sys, "executable", str(shell))

    return script


def test_progress_is_passed_on_and_the_job_is_what_the_worker_reads(job, pretend, tmp_path):
    pretend(f"cp $3 {tmp_path}/seen.json; echo view 1 2; echo view 2 2; touch {job.out}")
    told = []
    render(job, told.append)
    assert told == [1, 2]
    assert RenderJob.model_validate_json((tmp_path / "seen.json").read_text()) == job


def test_the_worker_stays_in_the_process_group_that_is_killed_with_the_stage(job, pretend, tmp_path):
    pretend(f"ps -o pgid= -p $$ > {tmp_path}/group; touch {job.out}")
    render(job, lambda _: None)
    assert int((tmp_path / "group").read_text()) == os.getpgrp()


def test_a_failure_is_told_with_the_last_words(job, pretend):
    pretend("seq 100 >&2; echo 'mesh is broken' >&2; exit 3")
    with pytest.raises(WorkerDied, match=r"(?s)0\.npz ended with exit code 3.*\n100\nmesh is broken") as caught:
        render(job, lambda _: None)
    assert "\n80\n" not in caught.value.problem


def test_a_killed_worker_is_told_with_its_signal(job, pretend):
    pretend("echo 'no memory left' >&2; kill -KILL $$")
    with pytest.raises(WorkerDied, match=r"(?s)signal SIGKILL.*no memory left") as caught:
        render(job, lambda _: None)
    assert "memory" in caught.value.remedy


def test_a_worker_that_leaves_nothing_has_failed(job, pretend):
    pretend("exit 0")
    with pytest.raises(WorkerDied, match="exit code 0"):
        render(job, lambda _: None)


def test_a_full_disk_is_told_from_a_crash(job, pretend):
    pretend("echo 'OSError: [Errno 28] No space left on device' >&2; exit 1")
    with pytest.raises(OSError, match="No space left"):
        render(job, lambda _: None)
