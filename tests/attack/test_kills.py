"""Kill whatever of a run lives, at random moments, and start it again: it ends in the digests of a run that nobody touched."""

from __future__ import annotations

import random
import shutil
import time
from collections import Counter, deque
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import psutil
import pytest

from aug3d_core.bench.team import leftovers
from tests.attack.town_process import ORDER, TownRun, damaged, digests

BEGINNING, END, BETWEEN = (
    "beginning",
    "end",
    "between",
)  # before the first stage, after the last, and where none is at work
PLACES = (BEGINNING, *ORDER, END)
MANY = 100
AT_LEAST = 2  # kills of each stage's own processes, among the many
SERVERS = ("factory", "fork server", "resource tracker", "Prefect's server")
BEGINNING_S, END_S = 8.0, 5.0  # how long they take
HANG_S = 600.0  # without an end, from the start or the last kill on: an untouched run takes one to three minutes
_STARTS = 60  # of one home

pytestmark = [pytest.mark.slow, pytest.mark.attack]


@dataclass
class Tally:
    """What was killed, and what came of it."""

    kills: Counter[tuple[str, str]] = field(default_factory=Counter)  # by kind of process and stage at work
    ends: Counter[str] = field(default_factory=Counter)  # of runs
    homes: int = 0
    wrong: list[str] = field(default_factory=list)

    def of(self, stage: str) -> int:
        """Return how often processes of a stage were killed."""
        return self.kills["stage", stage] + self.kills["worker", stage]

    def table(self) -> str:
        """Return the counts as lines."""
        kinds = sorted({kind for kind, _ in self.kills})
        lines = [f"{self.kills.total()} kills, {self.ends.total()} runs in {self.homes} homes: {dict(self.ends)}"]
        lines.append(f"{'':12}" + "".join(f"{kind[:17]:>18}" for kind in kinds))
        for place in (*PLACES, BETWEEN):
            lines.append(f"{place:12}" + "".join(f"{self.kills[kind, place]:18}" for kind in kinds))
        totals = (sum(count for (one, _), count in self.kills.items() if one == kind) for kind in kinds)
        lines.append(f"{'all':12}" + "".join(f"{total:18}" for total in totals))
        return "\n".join([*lines, f"{len(self.wrong)} wrong", *self.wrong])


@pytest.mark.long
@pytest.mark.timeout(4 * 3600)
def test_killed_at_a_hundred_moments(small_town: tuple[Path, dict[str, Any]], tmp_path: Path) -> None:
    rng, tally = random.Random(6), Tally()
    while tally.kills.total() < MANY:
        attack(tmp_path, [place for place in PLACES if rng.random() < 0.8], small_town[1], rng, tally)
    for _ in range(4):
        if missed := [stage for stage in ORDER if tally.of(stage) < AT_LEAST]:
            attack(tmp_path, missed, small_town[1], rng, tally, aimed=True)
    print(f"\n{tally.table()}")
    assert not tally.wrong
    assert all(tally.of(stage) >= AT_LEAST for stage in ORDER)
    assert all(any(kind == server for kind, _ in tally.kills) for server in SERVERS)


def attack(
    folder: Path,
    places: list[str],
    reference: Mapping[str, Any],
    rng: random.Random,
    tally: Tally,
    aimed: bool = False,
) -> None:
    """Make the small town in a new home, with a kill at each place in turn, and look at what came of it.

    Half of the kills go to a stage's own processes, the others to those that serve the run. aimed: all go to a stage's own,
    soon after it began, since the shortest last a second.
    """
    tally.homes += 1
    home, waiting = folder / f"home{tally.homes}", deque(places)
    spans = {name: figures["seconds"] for name, figures in reference["stages"].items()}
    of_stages, within = (1.0, 0.3) if aimed else (0.5, 1.0)
    spans |= {BEGINNING: BEGINNING_S, END: END_S}
    for _ in range(_STARTS):
        run, killed = TownRun(home, folder / "logs"), []
        try:
            while waiting and _wait_until(run, waiting[0], rng.random() * within * spans[waiting[0]]):
                killed.append(_kill_one(run, waiting.popleft(), rng, of_stages, tally))
            run.wait(HANG_S)
        except TimeoutError:
            alive = [(run.kind(process), process.pid) for process in run.living()]
            tally.wrong.append(f"home {tally.homes} hangs after {killed}; alive: {alive}; {run.progress}")
            run.end()
        else:
            tally.wrong += [f"home {tally.homes}, after {killed}: {one}" for one in _wrong(run, killed, tally)]
        if left := leftovers(home):
            tally.wrong.append(f"home {tally.homes}, after {killed}, these live on: {left}")
        if run.factory.returncode in (0, 3):
            tally.wrong += [f"home {tally.homes}: {one}" for one in _lost(home, run.told(), reference)]
            break
        if run.factory.returncode not in (1, -9) or not killed:
            break  # that was told above, and would come again
    print(f"\n{tally.table()}", flush=True)
    shutil.rmtree(home)


def _wait_until(run: TownRun, place: str, after_s: float) -> bool:
    """Wait for a moment of a run; False if it ended before. Raises TimeoutError."""

    def there() -> bool:
        if place == BEGINNING:
            return True
        return run.past_stages() if place == END else run.reached(place)

    begun = run.wait_for(there, HANG_S)
    until = time.monotonic() + after_s
    return begun and run.wait_for(lambda: time.monotonic() > until, HANG_S)


def _kill_one(run: TownRun, place: str, rng: random.Random, of_stages: float, tally: Tally) -> str:
    while living := run.living():
        working = [process for process in living if run.kind(process) in ("stage", "worker")]
        serving = [process for process in living if process not in working]
        victim = rng.choice(working if working and rng.random() < of_stages else serving or working)
        kind, stage = run.kind(victim), run.stage() or (END if run.past_stages() else "")
        try:
            victim.kill()
        except psutil.NoSuchProcess:  # it ended meanwhile
            continue
        tally.kills[kind, stage or (place if place == BEGINNING else BETWEEN)] += 1
        told = f"{kind} at {stage or place} after {time.monotonic() - run.started:.1f} s"
        print(f"{tally.kills.total()} {told}", flush=True)
        return told
    return "nothing"


def _wrong(run: TownRun, killed: list[str], tally: Tally) -> list[str]:
    """Say what is wrong with how a run ended."""
    code, progress, wrong = run.factory.returncode, run.progress.read_text(), []
    if "Traceback" in progress:
        wrong.append(f"a traceback: {progress[-3000:]}")
    if code == -9 and any(one.startswith("factory") for one in killed):
        tally.ends["killed"] += 1
        return wrong
    try:
        failure = run.told().get("failure")
    except ValueError:
        return [*wrong, f"exit code {code} and no JSON: {run.out.read_text()[-500:]} {progress[-1500:]}"]
    if code in (0, 3):
        tally.ends["well"] += 1
        return wrong
    tally.ends["failed"] += 1
    print(f"   failed: {failure and failure['problem'][:300]}", flush=True)
    if code != 1 or not failure or not killed:
        wrong.append(f"exit code {code}, failure {failure}, {progress[-1500:]}")
    return wrong


def _lost(home: Path, told: Mapping[str, Any], reference: Mapping[str, Any]) -> list[str]:
    """Say what a finished home lacks, by the untouched run and by `aug3d verify`."""
    now, then = digests(told), digests(reference)
    differ = sorted(name for name in {*now, *then} if now.get(name) != then.get(name))
    return [*([f"digests differ: {differ}"] if differ else []), *damaged(home)]
