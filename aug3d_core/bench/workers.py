"""Workers that share the work, as real processes of this machine: what a second one brings, what a kill and an outage cost.

The towns are the smallest that the factory makes. The store is moto's, whatever AUG3D_STORE names: it has to go away.
"""

from __future__ import annotations

import os
import shutil
import time
from collections import Counter
from collections.abc import Collection
from dataclasses import dataclass
from pathlib import Path
from statistics import median
from typing import Any

import psutil

from aug3d_core.bench.figure import Figure, at_least, at_most
from aug3d_core.bench.team import Team, TeamFailed, team
from aug3d_core.depth.files import RAW
from aug3d_core.factory.stages import FROM_TOWN
from aug3d_core.run.files import FILES, JOB, LOG
from aug3d_core.store import layout
from aug3d_core.studies.common.trial import Say

TOWNS = 6
AWAY_S = 60.0
WHOLE = 6  # depth maps of the victim, of 15: its two processes end theirs soon after one another, so two are new
LONG_DEPTH = {"depth": {"max_px": 320}}  # long enough to be killed in
_TAKEOVER_S = 120.0
_SHARD = f"{RAW}/[!.]*.planes"  # is written last of what there is of a depth map
_HOUR_S = 3600.0


@dataclass(frozen=True)
class Batch:
    """What came of a batch of towns.

    shared_s: processor time of what workers share, `aug3d up` and the store's service. idle: share of this machine's processor
    time that nobody used. workers: those that made a town; message: the last of the batch.
    """

    seconds: float
    shared_s: float
    idle: float
    message: str
    made: Counter[str]
    workers: frozenset[str]


@dataclass(frozen=True)
class Takeover:
    """What came of a town whose worker was killed.

    seconds: from the kill until the other worker begins to make the same object. whole, lost: depth maps that were whole in
    the victim's home at the kill, and those among them that the other did not get. run: as Prefect has it in the end.
    """

    victim: str
    seconds: float
    whole: int
    lost: int
    run: dict[str, Any]
    made: Counter[str]


@dataclass(frozen=True)
class Kills:
    """What came of a town whose worker was killed once in each stage.

    seconds: by stage, from the kill until another worker has a process for a stage of the town.
    """

    seconds: dict[str, float]
    run: dict[str, Any]
    made: Counter[str]


@dataclass(frozen=True)
class Outage:
    """What came of a town whose store was away. away_s: for how long; seconds: from its return until the next stage began."""

    away_s: float
    seconds: float
    run: dict[str, Any]
    made: Counter[str]


def batch_figures(folder: Path, say: Say, towns: int = TOWNS) -> dict[str, Figure]:
    """Make the same towns with two workers and with one, each bound to a core.

    Two come first: what this machine then has in memory is to the advantage of one. `aug3d up` and the store's service have
    no core of their own; on a machine of two cores they take from two workers what they do not take from one. How much that
    is, is told.
    """
    if len(os.sched_getaffinity(0)) < 2:
        failure = "this machine has one core"
        return {"two_workers_speedup": Figure(None, "times", 1.7, False, failure)}
    two = batch(folder / "two", towns, 2, say)
    one = batch(folder / "one", towns, 1, say)
    return {
        "two_workers_speedup": at_least(1.7, one.seconds / two.seconds, "times"),
        "two_workers_seconds": Figure(two.seconds, "s"),
        "one_worker_seconds": Figure(one.seconds, "s"),
        "shared_processor_seconds": Figure(two.shared_s, "s"),
        "two_workers_idle_share": Figure(two.idle, "share"),
        "one_worker_idle_share": Figure(one.idle, "share"),
        "towns_of_the_batch": Figure(towns, "towns"),
        "made_twice": at_most(0.0, made_twice(two.made), "objects"),
    }


def takeover_figures(folder: Path, say: Say) -> dict[str, Figure]:
    """Kill one of two workers in depth, at a bad moment: just as a depth map is whole, which nobody else has yet.

    A lost shard is a depth map that was whole in the victim's home and that the other worker had to make again. What the
    victim had begun and not finished, one map for each of its two processes, was never there, and is not counted; nor is what
    these made in the seconds that they outlived their worker, which a power cut would not give them.
    """
    found = takeover(folder / "kill", "depth", say, WHOLE)
    return {
        "takeover_seconds": at_most(_TAKEOVER_S, found.seconds, "s"),
        "lost_after_kill_shards": at_most(1.0, found.lost, "shards"),
        "whole_at_kill_shards": Figure(found.whole, "shards"),
        "made_twice_after_kill": at_most(0.0, made_twice(found.made), "objects"),
    }


def outage_figures(folder: Path, say: Say) -> dict[str, Figure]:
    """Let the store's service answer nothing for a minute while a worker is in depth.

    The worker finishes the step that it has in hand, and then waits, since a step counts when the store has it. Where it is
    still at it after the minute the service stays away until it waits: else there would be nothing to resume.
    """
    found = outage(folder / "outage", AWAY_S, say)
    return {
        "resume_seconds_after_store_outage": Figure(found.seconds, "s"),
        "store_outage_seconds": Figure(found.away_s, "s"),
        "made_twice_after_outage": at_most(0.0, made_twice(found.made), "objects"),
    }


def kill_figures(folder: Path, say: Say) -> dict[str, Figure]:
    """Kill the worker of a town once in each of its stages, as soon as that is seen; each time a machine with nothing joins."""
    found = kills(folder / "kills", say)
    seconds = found.seconds.values()
    return {
        "stages_killed_in": at_least(len(FROM_TOWN), len(seconds), "stages"),
        "slowest_takeover_seconds": at_most(_TAKEOVER_S, max(seconds, default=None), "s"),
        "median_takeover_seconds": Figure(median(seconds) if seconds else None, "s"),
        "made_twice_after_kills": at_most(0.0, made_twice(found.made), "objects"),
    }


PARTS = (batch_figures, takeover_figures, kill_figures, outage_figures)


def made_twice(made: Counter[str]) -> int:
    """Return how many objects were made more than once."""
    return sum(times > 1 for times in made.values())


def batch(folder: Path, towns: int, number: int, say: Say) -> Batch:
    """Make different towns with a number of workers, each bound to a core; raises TeamFailed if not all are made."""
    cores, who = sorted(os.sched_getaffinity(0)), f"workers: {number}"
    with team(_empty(folder), {f"town{seed}": {"town": {"seed": seed}} for seed in range(towns)}, ()) as members:
        for place in range(number):
            members.join(f"worker{place}", cores[place % len(cores)])
        say(who, 0, towns, "towns")
        before, idle_before = members.shared_s(), psutil.cpu_times().idle
        started, run = time.monotonic(), members.start_all()
        ended = members.end_of(run, 3 * _HOUR_S)
        seconds = time.monotonic() - started
        shared_s = members.shared_s() - before
        idle = (psutil.cpu_times().idle - idle_before) / (os.cpu_count() or 1) / seconds
        say(who, towns, towns, "towns")
        _check(members, ended)
        workers = map(members.worker_of, members.scenes())
        return Batch(seconds, shared_s, idle, ended["message"], members.made(), frozenset(workers))


def takeover(folder: Path, stage: str, say: Say, whole: int = 0) -> Takeover:
    """Make a town, and kill its worker when it is at a stage; raises TeamFailed if the other worker does not go on.

    The other makes a town of its own meanwhile: with nothing to do it would help, and what it had made so could not be told
    from what it was given. Each has a core. whole: how many depth maps the victim shall have, the last a moment old.
    """
    cores, own = sorted(os.sched_getaffinity(0)), LONG_DEPTH if stage == "depth" else {}
    with team(_empty(folder), {"town": own, "beside": {"town": {"seed": 1}}}, ()) as members:
        for place, name in enumerate(("one", "two")):
            members.join(name, cores[place % len(cores)])
        run = members.start("town")
        say("kill -9", 0, 3, f"waiting for {stage}")
        members.wait(lambda: bool(members.worker_of("town")), 120, "a worker takes the town")
        victim = members.worker_of("town")
        other = {"one": "two", "two": "one"}[victim]
        members.start("beside", on=other)
        members.wait(lambda: stage in members.stages(victim), 900, f"{victim} makes {stage}")
        members.wait(lambda: len(_shards(folder / victim)) >= whole, 600, f"{whole} depth maps are made", every_s=0.05)
        there, killed = _shards(folder / victim), time.monotonic()
        members.kill(victim)
        key = _begun(folder / victim, stage)
        say("kill -9", 1, 3, f"waiting until {other} takes over")
        members.wait(lambda: _has_taken(folder / other, stage, key), 300, f"{other} makes {stage} {key}", every_s=0.1)
        seconds = time.monotonic() - killed
        got = brought(folder / other / layout.WORK / stage / key) if whole else set()
        say("kill -9", 2, 3, f"{other} is at {stage}")
        _check(members, members.end_of(run, _HOUR_S))
        return Takeover(victim, seconds, len(there), len(there - got), members.scenes()["town"], members.made())


def kills(folder: Path, say: Say) -> Kills:
    """Make a town, and kill whatever worker is first seen at each stage; raises TeamFailed if no other goes on."""
    cores, seconds = sorted(os.sched_getaffinity(0)), dict[str, float]()
    stages = {stage.name for stage in FROM_TOWN}
    with team(_empty(folder), {"town": {}}, ()) as members:
        core_of = {f"worker{place}": cores[place % len(cores)] for place in range(2)}
        for name, core in core_of.items():
            members.join(name, core)
        run = members.start("town")
        while found := _next_at(members, run, stages - seconds.keys()):
            victim, stage = found
            members.kill(victim)
            killed = time.monotonic()
            core_of[name := f"worker{len(core_of)}"] = core_of[victim]
            members.join(name, core_of[name])  # long before a takeover: the next stages may be short
            members.wait(lambda: _goes_on(members), 300, f"another worker goes on after {stage}", every_s=0.2)
            seconds[stage] = time.monotonic() - killed
            say("kill -9", len(seconds), len(stages), f"stages; the last: {stage}")
        _check(members, members.end_of(run, _HOUR_S))
        return Kills(seconds, members.scenes()["town"], members.made())


def _next_at(members: Team, run: str, stages: Collection[str]) -> tuple[str, str] | None:
    """Wait until a worker makes the town at one of these stages, and return both; None if the run ends before.

    Who only helps at the stage is not meant.
    """
    found: list[tuple[str, str]] = []

    def so() -> bool:
        maker = members.worker_of("town")
        found[:] = (
            [(maker, stage) for stage in members.stages(maker) if stage in stages] if maker in members.workers else []
        )
        return bool(found) or members.run(run)["end_time"] is not None

    members.wait(so, _HOUR_S, "the town is made", every_s=0.2)
    return found[0] if found else None


def _goes_on(members: Team) -> bool:
    maker = members.worker_of("town")
    return maker in members.workers and bool(members.stages(maker))


def outage(folder: Path, away_s: float, say: Say) -> Outage:
    """Make a town with one worker, and let its store go away while it is in depth; raises TeamFailed if it does not go on."""
    with team(_empty(folder), {"town": {}}, ("one",)) as members:
        run = members.start_all()
        say("store away", 0, 3, "waiting for depth")
        members.wait(lambda: bool(_shards(folder / "one")), 900, "depth is being made")
        say("store away", 1, 3, f"the store is away for {away_s:.0f} s")
        with members.store_away():
            went = time.monotonic()
            time.sleep(away_s)
            members.wait(lambda: not members.stages("one"), 400, "the worker waits for its store")
        back = time.monotonic()
        members.wait(lambda: bool(members.stages("one")), 300, "the worker goes on", every_s=0.05)
        seconds = time.monotonic() - back
        say("store away", 2, 3, "the worker goes on")
        _check(members, members.end_of(run, _HOUR_S))
        return Outage(back - went, seconds, members.scenes()["town"], members.made())


def brought(work: Path) -> set[str]:
    """Return which depth maps a machine was given, in a work folder: those older than the job.

    What another machine left comes first, then the job is written, then the stage begins.
    """
    job_ns = (work / JOB).stat().st_mtime_ns
    return {shard.name for shard in (work / FILES).glob(_SHARD) if shard.stat().st_mtime_ns <= job_ns}


def _shards(home: Path) -> set[str]:
    """Return which depth maps are whole in a home whose worker is in depth."""
    return {shard.name for shard in home.glob(f"{layout.WORK}/depth/*/{FILES}/{_SHARD}")}


def _begun(home: Path, stage: str) -> str:
    """Return the key of the object of a stage that a killed worker has left half made."""
    keys = [job.parent.name for job in home.glob(f"{layout.WORK}/{stage}/*/{JOB}")]
    if len(keys) != 1:
        raise TeamFailed(f"{home.name} was killed while {len(keys)} objects of {stage} were made", "try again")
    return keys[0]


def _has_taken(home: Path, stage: str, key: str) -> bool:
    """Say whether a worker makes an object, or has made it: what was handed over may have left little to do."""
    return (home / layout.WORK / stage / key / JOB).exists() or (home / layout.OBJECTS / stage / key / LOG).exists()


def _check(members: Team, ended: dict[str, Any]) -> None:
    if ended["type"] != "COMPLETED":
        raise TeamFailed(f"the batch ended as {ended['name']}: {ended['message']}", f"see the logs in {members.folder}")


def _empty(folder: Path) -> Path:
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    return folder
