"""What a dead machine has made of a thing, the next one goes on with; what is whole and done leaves nothing behind."""

from __future__ import annotations

import os
import threading
from collections.abc import Callable
from pathlib import Path

import pytest

from aug3d_core.store import hand_over
from aug3d_core.store.bucket import Bucket
from aug3d_core.store.hand_over import handing_over, helping

SHARDS = ("raw/[!.]*", "checkpoint/*.pt")


@pytest.fixture(autouse=True)
def hasty(monkeypatch: pytest.MonkeyPatch) -> None:
    for pause in ("PUT_S", "TAKE_S"):
        monkeypatch.setattr(hand_over, pause, 0.1)


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


def test_what_is_whole_is_shared_at_once_though_others_are_seldom_asked(
    tmp_path: Path, bucket: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Whoever makes a shard in three seconds loses one when it is killed, not what five seconds hold."""
    monkeypatch.setattr(hand_over, "TAKE_S", 3600.0)
    place, other = Bucket(bucket), Bucket(bucket)
    with handing_over(place, "depth/k", tmp_path / "files", SHARDS, helped=True):
        asked = place.tally.traffic().requests.get("list", 0)
        for name in ("a", "b"):
            write(tmp_path / "files", f"raw/{name}", "map")
            wait_for(lambda name=name: other.has(f"work/depth/k/raw/{name}"))
        assert place.tally.traffic().requests.get("list", 0) == asked


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


def test_shards_of_a_machine_that_helps_are_used_and_go_when_the_work_is_done(tmp_path: Path, bucket: str) -> None:
    place, one, two = Bucket(bucket), tmp_path / "one" / "files", tmp_path / "two" / "files"
    (one / "raw").mkdir(parents=True)
    with handing_over(place, "depth/k", one, SHARDS, helped=True) as spent:
        write(one, "raw/a", "first")
        wait_for(lambda: place.names("work/depth/k/") == ["work/depth/k/raw/a"])
        with helping(place, "depth/k", two, SHARDS) as tell:
            assert files(two) == {"raw/a": "first"}
            write(two, "raw/z", "last")
            write(one, "raw/b", "second")
            wait_for(lambda: "raw/z" in files(one) and "raw/b" in files(two))
            write(two, "raw/y", "just before the end")
            tell(2.5)
        wait_for(lambda: "raw/y" in files(one))
        assert files(one) == {"raw/a": "first", "raw/b": "second", "raw/y": "just before the end", "raw/z": "last"}
        assert spent() == 2.5
    assert place.names("work/") == []


def test_what_the_owner_has_put_away_does_not_come_back(tmp_path: Path, bucket: str) -> None:
    """Raw depth is deleted once it is compared: what others still make of it must not get into the object."""
    place, one = Bucket(bucket), tmp_path / "one" / "files"
    write(one, "checkpoint/1.pt", "state")
    (one / "raw").mkdir()
    with handing_over(place, "depth/k", one, SHARDS, helped=True):
        place.put("work/depth/k/raw/z", b"theirs")
        wait_for(lambda: "raw/z" in files(one))
        (one / "raw" / "z").unlink()
        (one / "raw").rmdir()
        place.put("work/depth/k/raw/y", b"too late")
        (one / "checkpoint/1.pt").unlink()
        write(one, "checkpoint/2.pt", "next state")
        wait_for(lambda: place.names("work/depth/k/checkpoint/") == ["work/depth/k/checkpoint/2.pt"])
        threading.Event().wait(0.5)
        assert files(one) == {"checkpoint/2.pt": "next state"} and not (one / "raw").exists()
        assert "work/depth/k/raw/z" not in place.names("work/"), "nor does anybody else bring it"


def test_what_is_here_is_not_replaced_by_what_others_made(tmp_path: Path, bucket: str) -> None:
    place, one = Bucket(bucket), tmp_path / "one" / "files"
    write(one, "raw/a", "mine")
    write(one, "other/c", "no shard")
    with helping(place, "depth/k", one, SHARDS):
        for name in ("raw/b", "raw/a", "other/d"):
            place.put(f"work/depth/k/{name}", b"theirs")
        wait_for(lambda: "raw/b" in files(one))
        assert files(one) == {"raw/a": "mine", "raw/b": "theirs", "other/c": "no shard"}


def test_no_name_leads_out_of_the_folder(tmp_path: Path, bucket: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """A name of another machine may be anything, an absolute path too."""
    outside, folder = tmp_path / "outside", tmp_path / "in" / "files"
    names = ["raw/a", f"/{outside}/raw/b", "raw/../../../outside/c", "./raw/d"]
    put = {f"work/depth/k/{name}": b"theirs" for name in names}
    monkeypatch.setattr(Bucket, "names", lambda self, prefix: [name for name in put if name.startswith(prefix)])
    monkeypatch.setattr(Bucket, "download", lambda self, name, file: file.write_bytes(put[name]))
    with pytest.raises(KeyboardInterrupt), handing_over(Bucket(bucket), "depth/k", folder, SHARDS, helped=True):
        assert files(folder) == {"raw/a": "theirs"} and not outside.exists()
        raise KeyboardInterrupt
