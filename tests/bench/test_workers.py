"""What two workers, a kill and an outage are measured by, and that the command tells it. The teams are stand-ins."""

from __future__ import annotations

import os
import time
from collections import Counter
from pathlib import Path

import pytest
from typer.testing import CliRunner

from aug3d_core.bench import machines, team, workers
from aug3d_core.bench.figure import Figure
from aug3d_core.run.errors import Aug3dError
from flows.cli import app


def say(*_: object) -> None:
    pass


def test_maps_that_are_older_than_the_job_were_given_and_later_ones_made(tmp_path: Path) -> None:
    raw = tmp_path / "files" / "raw"
    raw.mkdir(parents=True)
    (tmp_path / "job.json").write_text("{}")
    for number, age_s in enumerate((20.0, 10.0, -10.0)):
        shard, at_s = raw / f"{number:06d}.png.planes", time.time() - age_s
        for file in (shard, raw / f".{shard.name}.123", raw / f"{number:06d}.png.geometric.bin"):
            file.write_text("7")
            os.utime(file, (at_s, at_s))
    assert workers.brought(tmp_path) == {"000000.png.planes", "000001.png.planes"}


def test_the_figures_of_a_batch_compare_one_with_two(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(os, "sched_getaffinity", lambda _: {3, 5})
    asked = []

    def batch(folder: Path, towns: int, number: int, _: object) -> workers.Batch:
        asked.append((folder.name, towns, number))
        made = Counter({"town a": 1, "town b": number})
        return workers.Batch({1: 300.0, 2: 150.0}[number], 45.0, 0.1, "", made, frozenset())

    monkeypatch.setattr(workers, "batch", batch)
    found = workers.batch_figures(tmp_path, say, 4)
    assert asked == [("two", 4, 2), ("one", 4, 1)]
    assert found["two_workers_speedup"] == Figure(2.0, "times", 1.7, True)
    assert found["made_twice"] == Figure(1, "objects", 0.0, False)
    assert (found["two_workers_idle_share"].value, found["shared_processor_seconds"].value) == (0.1, 45.0)


def test_one_core_is_told_not_measured(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(os, "sched_getaffinity", lambda _: {0})
    [figure] = workers.batch_figures(tmp_path, say).values()
    assert (figure.value, figure.holds, figure.failure) == (None, False, "this machine has one core")


def test_a_takeover_and_an_outage_are_held_to_their_goals(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    once = Counter({"town a": 1})
    monkeypatch.setattr(workers, "takeover", lambda *_: workers.Takeover("one", 90.0, 5, 2, {}, once))
    monkeypatch.setattr(workers, "outage", lambda _, away_s, __: workers.Outage(away_s + 3, 4.0, {}, once))
    found = workers.takeover_figures(tmp_path, say) | workers.outage_figures(tmp_path, say)
    assert {name: figure.value for name, figure in found.items()} == {
        "takeover_seconds": 90.0,
        "lost_after_kill_shards": 2,
        "whole_at_kill_shards": 5,
        "made_twice_after_kill": 0,
        "resume_seconds_after_store_outage": 4.0,
        "store_outage_seconds": 63.0,
        "made_twice_after_outage": 0,
    }
    assert found["takeover_seconds"].holds and not found["lost_after_kill_shards"].holds


def test_each_stage_is_to_be_killed_in_and_the_slowest_takeover_counts(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    seconds = {"town": 80.0, "photos": 121.0, "sfm": 82.0}
    monkeypatch.setattr(workers, "kills", lambda *_: workers.Kills(seconds, {}, Counter({"town a": 1})))
    found = workers.kill_figures(tmp_path, say)
    assert found["slowest_takeover_seconds"] == Figure(121.0, "s", 120.0, False)
    assert found["median_takeover_seconds"].value == 82.0
    assert found["stages_killed_in"].value == 3 and not found["stages_killed_in"].holds


@pytest.mark.parametrize("asked", [[], ["--workers"]])
def test_workers_are_measured_where_that_is_asked_for(
    asked: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(machines, "figures", lambda *_: {"s3_up": Figure(1.0, "MiB")})
    monkeypatch.setattr(workers, "PARTS", (lambda folder, say: {"takeover_seconds": Figure(90.0, "s")},))
    done = CliRunner().invoke(app, ["bench", "machines", *asked, "--home", str(tmp_path), "--json"])
    assert done.exit_code == 0, done.output
    assert ("takeover_seconds" in done.stdout) == bool(asked) and '"s3_up"' in done.stdout


def test_what_was_found_is_told_before_a_part_fails(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def fails(*_: object) -> dict[str, Figure]:
        raise team.TeamFailed("not in 900 s: depth is being made", "see the logs")

    monkeypatch.setattr(machines, "figures", lambda *_: {"s3_up": Figure(1.0, "MiB")})
    monkeypatch.setattr(workers, "PARTS", (fails,))
    done = CliRunner().invoke(app, ["bench", "machines", "--workers", "--home", str(tmp_path)])
    assert done.exit_code == 1 and issubclass(team.TeamFailed, Aug3dError)
    assert "s3_up: 1 MiB" in done.output and "not in 900 s" in done.output
