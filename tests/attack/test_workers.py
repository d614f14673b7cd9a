"""Machines that share the work: one goes dark and another takes over within two minutes; scenes and studies are spread."""

from __future__ import annotations

import json
import os
import shlex
import shutil
import subprocess
import time
from collections.abc import Callable
from pathlib import Path

import pytest
import yaml

from aug3d_core.bench.team import AUG3D, leftovers, team
from aug3d_core.bench.workers import TOWNS, WHOLE, batch, takeover
from aug3d_core.run.files import LOG
from aug3d_core.store.layout import STUDIES, STUDY_PAGE

pytestmark = [pytest.mark.slow, pytest.mark.long, pytest.mark.timeout(4 * 3600)]
WITHIN_S = 120.0
CC = shutil.which("cc")


@pytest.mark.attack
@pytest.mark.parametrize("stage", ["town", "matching", "depth", "training"])
def test_another_worker_takes_over_what_a_killed_one_did(stage: str, own_environment: None, tmp_path: Path) -> None:
    found = takeover(tmp_path / "team", stage, say, WHOLE if stage == "depth" else 0)
    print(f"\n{stage}: at work again after {found.seconds:.0f} s; lost {found.lost} of {found.whole} depth maps")
    assert found.seconds < WITHIN_S
    assert leftovers(tmp_path / "team" / found.victim) == []
    assert (found.run["state"]["name"], found.run["run_count"]) == ("Published", 2), found.run["state"]["message"]
    assert set(found.made.values()) == {1}


@pytest.mark.parametrize("number", [3, 2, 1])
def test_workers_make_each_object_once(number: int, own_environment: None, tmp_path: Path) -> None:
    """The seconds are told, not judged: `aug3d bench machines --workers` compares them."""
    found = batch(tmp_path / "team", TOWNS, number, say)
    print(f"\n{TOWNS} towns, {number} workers: {found.seconds:.0f} s")
    assert found.message == f"{TOWNS} scenes are up to date"
    assert set(found.made.values()) == {1}
    assert len(found.workers) == number


def test_a_study_is_spread_over_all_machines(own_environment: None, tmp_path: Path) -> None:
    """The machine of `aug3d up` makes cells too, and publishes."""
    with team(tmp_path, {}, ("one", "two")) as workers:
        started = time.monotonic()
        study = workers.start("stability", only=["blur", "slope", "abrupt", "holes"], quick=True)
        ended = workers.end_of(study, 1800)
        print(f"\n{ended['message']} after {time.monotonic() - started:.0f} s")
        assert ended["type"] == "COMPLETED" and "none silent" in ended["message"], ended["message"]
        assert set(workers.made().values()) == {1}
        made = {name: len([*(tmp_path / name / "objects").glob(f"*/*/{LOG}")]) for name in ("up", "one", "two")}
        print(made)
        assert min(made.values()) >= 3, "all had work"
        assert len([*(tmp_path / "up" / STUDIES).rglob(STUDY_PAGE)]) == 1


def test_an_idle_machine_helps_with_a_step_that_takes_long(own_environment: None, tmp_path: Path) -> None:
    """One scene, made by a machine alone and by two: the same bytes. The seconds are told, not judged."""
    cores, digests = sorted(os.sched_getaffinity(0)), set[str]()
    for number in (1, 2):
        folder = tmp_path / str(number)
        with team(folder, {"town": {"depth": {"max_px": 320, "plane_step_px": 0.1}}}, ()) as workers:
            for place in range(number):
                workers.join(f"worker{place}", cores[place % len(cores)])
            assert workers.end_of(workers.start_all(), 3600)["type"] == "COMPLETED"
            [version] = folder.glob("*/scenes/town/*/metrics.json")
            depth = json.loads(version.read_bytes())["stages"]["depth"]
            helped = [run for run in workers.ask("flow_runs/filter", {}) if run["name"].startswith("help with ")]
            states = [(run["state"]["name"], run["state"]["message"]) for run in helped]
            print(f"\n{number} machines: depth in {depth['seconds']} s, {depth['cpu_seconds']} processor s; {states}")
            digests.add(depth["digest"])
            assert bool(helped) == (number == 2)
            assert set(workers.made().values()) == {1}
    assert len(digests) == 1


def test_a_worker_makes_a_scene_whose_photographs_it_does_not_have(
    own_environment: None, small_disk: Callable[[int], Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The folder is an empty disk for the worker, by a mount of its own."""
    small_disk(1)  # skips where nothing can be mounted
    with team(tmp_path, {"town": {}}, ("one",)) as workers:
        assert workers.end_of(workers.start_all(), 1800)["type"] == "COMPLETED"
        [taken] = (tmp_path / "one" / "objects" / "town").glob("*/files/photos")
        folder, command = tmp_path / "card", tmp_path / "aug3d"
        shutil.copytree(taken, folder)
        hidden = f'mount -t tmpfs tmpfs {shlex.quote(str(folder))} && exec {shlex.quote(AUG3D)} "$@"'
        command.write_text(f'#!/bin/sh\nexec unshare --mount sh -c {shlex.quote(hidden)} aug3d "$@"\n')
        command.chmod(0o755)
        workers.kill("one")
        monkeypatch.setattr("aug3d_core.bench.team.AUG3D", str(command))
        workers.join("two")
        town = yaml.safe_load((tmp_path / "up" / "scenes" / "town.yaml").read_text())
        settings = {stage: own for stage, own in town["settings"].items() if stage != "town"}
        entry = {"photos": str(folder), "preset": "tiny", "settings": settings}
        (tmp_path / "up" / "scenes" / "flown.yaml").write_text(yaml.safe_dump(entry))
        workers.wait(lambda: any(one["name"] == "flown" for one in workers.ask("deployments/filter", {})), 120, "known")
        assert workers.end_of(workers.start("flown"), 1800)["name"] == "Published"
        runs = {run["name"]: run["labels"]["prefect.worker.name"] for run in workers.ask("flow_runs/filter", {})}
        assert runs["flown"].startswith(workers.machine("two"))
        assert runs["photographs of flown"].startswith(workers.machine("up"))
        assert set(workers.made().values()) == {1}
        assert not [*(tmp_path / "two" / "objects" / "photos").glob(f"*/{LOG}")], "they were read where they are"


@pytest.mark.skipif(CC is None, reason="there is no C compiler: apt-get install gcc")
def test_clocks_may_be_five_minutes_wrong(own_environment: None, tmp_path: Path) -> None:
    """One machine is five minutes early and is killed; the other, five minutes late, goes on as soon as its clock lets it."""
    towns = {f"town{seed}": {"town": {"seed": seed}} for seed in (1, 2)}
    library = tmp_path / "wrong_clock.so"
    source = Path(__file__).with_name("wrong_clock.c")
    subprocess.run([str(CC), "-shared", "-fPIC", "-o", str(library), str(source), "-ldl"], check=True)
    with team(tmp_path, towns, ()) as workers:
        for name, wrong_s in (("late", -300), ("early", 300)):
            workers.join(name, more={"LD_PRELOAD": str(library), "WRONG_BY_S": str(wrong_s)})
        batch = workers.start_all()
        workers.wait(lambda: bool(workers.at_work("matching")), 900, "matching")
        assert workers.at_work("matching") == ["early"]
        workers.kill("early")
        killed = time.monotonic()
        workers.wait(lambda: "late" in map(workers.worker_of, towns), 900, "taken over", every_s=2)
        print(f"\ntaken over after {time.monotonic() - killed:.0f} s")
        assert workers.end_of(batch, 2400)["message"] == f"{len(towns)} scenes are up to date"
        assert set(workers.made().values()) == {1}
        assert {run["state"]["name"] for run in workers.scenes().values()} == {"Published"}


def say(stage: str, done: int, total: int, what: str) -> None:
    print(f"{stage}: {done} of {total} {what}")
