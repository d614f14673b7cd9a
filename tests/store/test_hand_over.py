"""What a dead machine has made of a thing, the next one goes on with; what is whole and done leaves nothing behind."""

from __future__ import annotations

import os
import threading
from collections.abc import Callable
from pathlib import Path

import pytest

from aug3d_core.store import hand_over
from aug3d_core.store.bucket import Bucket
from aug3d_core.store.hand_over import handing_over

SHARDS = ("raw/[!.]*", "checkpoint/*.pt")


@pytest.fixture(autouse=True)
def hasty(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(hand_over, "PERIOD_S", 0.1)


def write(folder: Path, name: str, content: str, time_s: int = 0) -> None:
    file = folder / name
    file.parent.mkdir(parents=True, exist_ok=True)
    file.write_text(content)
    if time_s:
        os.utime(file, (time_s, time_s))


def wait_for(true: Callable[[], bool]) -> None:
    for _ in range(600):
        if true():
            return
        threading.Event().wait(0.05)
    raise AssertionError("it did not come to be")


def files(folder: Path) -> dict[str, str]:
    return {path.relative_to(folder).as_posix(): path.read_text() for path in folder.rglob("*") if path.is_file()}


def test_shards_of_a_machine_that_died_are_gone_on_with(tmp_path: Path, bucket: str) -> None:
    place, one, two = Bucket(bucket), tmp_path / "one" / "files", tmp_path / "two" / "files"
    with pytest.raises(KeyboardInterrupt), handing_over(place, "depth/k", one, SHARDS):
        write(one, "raw/a", "map")
        write(one, "raw/.b", "half a map")
        write(one, "other/c", "not a shard")
        write(one, "checkpoint/1.pt", "state")
        wait_for(lambda: len(place.names("work/depth/k/")) == 2)
        (one / "checkpoint/1.pt").unlink()
        write(one, "checkpoint/2.pt", "next state")
        wait_for(lambda: place.names("work/depth/k/") == ["work/depth/k/checkpoint/2.pt", "work/depth/k/raw/a"])
        raise KeyboardInterrupt
    with handing_over(place, "depth/k", two, SHARDS):
        assert files(two) == {"raw/a": "map", "checkpoint/2.pt": "next state"}
    assert place.names("work/") == []


def test_what_this_machine_has_of_it_is_what_it_goes_on_with(tmp_path: Path, bucket: str) -> None:
    place, here = Bucket(bucket), tmp_path / "files"
    place.put("work/depth/k/raw/a", b"theirs")
    write(here, "raw/a", "mine")
    with handing_over(place, "depth/k", here, SHARDS):
        assert files(here) == {"raw/a": "mine"}


def test_shards_are_shared_in_the_order_they_were_made(
    tmp_path: Path, bucket: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A file may say that those before it are there."""
    put: list[str] = []
    monkeypatch.setattr(Bucket, "put", lambda self, name, content: put.append(name.rpartition("/")[2]))
    for at, name in enumerate(("z", "m", "a")):
        write(tmp_path, f"raw/{name}", "x", 1000 + at)
    with handing_over(Bucket(bucket), "depth/k", tmp_path, SHARDS):
        wait_for(lambda: len(put) == 3)
    assert put == ["z", "m", "a"]
