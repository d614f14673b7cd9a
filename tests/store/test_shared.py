"""Machines with homes of their own and one store: each thing is made once, whole for all, whatever dies in between."""

from __future__ import annotations

import threading
from collections.abc import Callable
from contextlib import nullcontext
from http.server import BaseHTTPRequestHandler, HTTPServer
from pathlib import Path
from typing import ClassVar

import obstore
import pytest

from aug3d_core.bench.s3_service import KEYS, s3_service
from aug3d_core.run.errors import StoreError
from aug3d_core.run.files import FILES, LOG
from aug3d_core.store import bucket as bucket_module
from aug3d_core.store import layout
from aug3d_core.store import lease as lease_module
from aug3d_core.store.bucket import Bucket
from aug3d_core.store.damage import DamagedError
from aug3d_core.store.lease import lease
from aug3d_core.store.published import publish, published
from aug3d_core.store.record import Record
from aug3d_core.store.scenes import (
    bring_report,
    bring_versions,
    new_version,
    scenes,
    share_version,
    version_metrics,
    versions,
    write_metrics,
)
from aug3d_core.store.store import Store
from tests.store.test_store import FIELDS, commit
from tests.tests_support import flip

NEVER: Callable[[], bool] = lambda: False  # noqa: E731


def read(store: Store, record: Record) -> str:
    return (store.files_dir(record) / "sub" / "a.txt").read_text()


def test_what_one_machine_made_another_finds_and_reads(tmp_path: Path, shared: str) -> None:
    maker, other = Store(tmp_path / "maker"), Store(tmp_path / "other")
    made = commit(maker)
    found = other.find("photos", "k1")
    assert found == made
    assert not (other.place(made) / "sub" / "a.txt").exists(), "what is not read is not brought"
    assert read(other, made) == "hello"
    assert other.take("photos", "k1") == (made, "")


def test_what_was_brought_is_not_asked_for_again(tmp_path: Path, shared: str, monkeypatch: pytest.MonkeyPatch) -> None:
    other = Store(tmp_path / "other")
    made = commit(Store(tmp_path / "maker"))
    read(other, made)
    monkeypatch.setattr(Bucket, "_ask", lambda *_: pytest.fail("a request"))
    assert other.take("photos", "k1") == (made, "")
    assert read(other, made) == "hello"
    assert Store(tmp_path / "maker").take("photos", "k1") == (made, "")


def test_damage_here_is_mended_from_there(tmp_path: Path, shared: str) -> None:
    other = Store(tmp_path / "other")
    made = commit(Store(tmp_path / "maker"))
    read(other, made)
    flip(other.place(made) / "sub" / "a.txt")
    with pytest.raises(DamagedError):
        read(other, made)
    found = other.find("photos", "k1")
    assert found and read(other, found) == "hello"


def test_damage_there_is_named_and_read_by_nobody(tmp_path: Path, shared: str) -> None:
    made = commit(Store(tmp_path / "maker"))
    digest = made.files["sub/a.txt"].sha256
    Bucket(shared).put(f"blobs/{digest}", b"hallo")
    other = Store(tmp_path / "other")
    with pytest.raises(StoreError, match=f"blobs/{digest} holds other bytes"):
        read(other, made)
    assert not [file for file in other.place(made).rglob("*") if file.is_file()]


@pytest.mark.parametrize("times", range(5))
def test_two_makers_of_one_object_end_with_one(tmp_path: Path, shared: str, times: int) -> None:
    """Ten times each: the bytes differ, as times in files do, and both end with those that were first."""
    for number in range(10):
        stores = [Store(tmp_path / f"{name}{number}") for name in ("one", "two")]
        start, ends = threading.Barrier(2), {}

        def make(at: int, stores=stores, start=start, ends=ends, key: str = f"k{number}") -> None:
            start.wait()
            ends[at] = commit(stores[at], f"made by {at}", key)

        threads = [threading.Thread(target=make, args=(at,)) for at in range(2)]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
        assert ends[0] == ends[1]
        assert read(stores[0], ends[0]) == read(stores[1], ends[1])
        names = Bucket(shared).names(f"objects/photos/k{number}/")
        assert [name.rpartition("/")[2] for name in names].count(layout.RECORD) == 1


def test_work_that_ends_after_another_machine_s_was_brought_here_ends_as_that(tmp_path: Path, shared: str) -> None:
    """The right to make it lapsed while this machine slept; another made it, and a dry run here saw its record."""
    late, other = Store(tmp_path / "late"), Store(tmp_path / "other")
    made = commit(other, "made by the other")
    assert late.find("photos", "k1") == made
    assert commit(late, "made here") == made
    assert read(late, made) == "made by the other"


def test_of_many_who_create_a_name_one_wins(bucket: str) -> None:
    place, won, start = Bucket(bucket), [], threading.Barrier(64)

    def create(content: bytes) -> None:
        start.wait()
        if place.create("name", content):
            won.append(content)

    threads = [threading.Thread(target=create, args=(str(number).encode(),)) for number in range(64)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert won == [place.get("name")]


def test_an_object_made_before_there_was_a_store_is_shared_when_it_is_used(
    tmp_path: Path, bucket: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    made = commit(Store(tmp_path / "maker"))
    monkeypatch.setenv("AUG3D_STORE", bucket)
    assert Store(tmp_path / "other").find("photos", "k1") is None
    assert Store(tmp_path / "maker").whole("photos", "k1") is None
    Store(tmp_path / "maker").take("photos", "k1")
    assert Store(tmp_path / "maker").whole("photos", "k1") == made
    assert read(Store(tmp_path / "other"), made) == "hello"


def test_versions_and_what_is_published_are_seen_by_all(tmp_path: Path, shared: str) -> None:
    maker, other = Store(tmp_path / "maker"), Store(tmp_path / "other")
    assert scenes(other) == []
    other = Store(tmp_path / "other")
    version = new_version(maker, "hill")
    (version / layout.REPORT).write_text("<p>a report")
    write_metrics(version, {"scene": "hill", "state": "ok"})
    assert scenes(other) == [], "it counts from the moment that it is shared"
    share_version(maker, version, [])
    publish(maker, version)
    assert scenes(other) == [], "a command, and a run, looks once"
    other = Store(tmp_path / "other")
    assert scenes(other) == ["hill"]
    [found] = versions(other, "hill")
    assert found.name == version.name and not (found / layout.REPORT).exists(), "what nobody reads is not brought"
    bring_report(other, found)
    assert (found / layout.REPORT).read_text() == "<p>a report"
    assert version_metrics(found)["state"] == "ok"
    assert published(other, "hill") == found
    for store, there in ((maker, version), (other, found)):
        before = store.traffic()
        share_version(store, there, [])
        assert store.traffic().since(before).requests == {"head": 1}, "it is there already"


def test_names_from_the_store_stay_in_their_folder(tmp_path: Path, shared: str) -> None:
    place = Bucket(shared)
    for name in ("scenes/hill/v1/metrics.json", "scenes/hill/v1/..%2F..%2Fout.txt", "scenes/x/.../metrics.json"):
        obstore.put(place._service, name, b"{}")
    other = Store(tmp_path / "other")
    scenes(other)
    assert {file.resolve().is_relative_to(other.root) for file in tmp_path.rglob("*")} == {True}


@pytest.fixture
def hasty(monkeypatch: pytest.MonkeyPatch) -> None:
    for name, seconds in {"RENEW_S": 0.2, "LAPSED_S": 4.0, "LOOK_S": 0.1}.items():
        monkeypatch.setattr(lease_module, name, seconds)


def test_a_lease_is_held_by_one_and_then_by_the_next(bucket: str, hasty: None) -> None:
    place, holding, most = Bucket(bucket), [], []

    def work(number: int) -> None:
        with lease(place, "town/k", NEVER, lambda host: None) as ours:
            assert ours
            holding.append(number)
            most.append(len(holding))
            threading.Event().wait(5.0 if number == 0 else 0.1)  # longer than a lease that is not renewed
            holding.remove(number)

    threads = [threading.Thread(target=work, args=(number,)) for number in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert most == [1, 1, 1, 1]
    assert place.names("leases/") == []


def test_the_lease_of_a_dead_owner_lapses_and_one_of_many_takes_it(bucket: str, hasty: None) -> None:
    place, told, held = Bucket(bucket), [], []
    place.create("leases/town/k/00000000", b'{"host": "dead"}')
    done = threading.Event()

    def wait() -> None:
        with lease(place, "town/k", lambda: done.is_set(), told.append) as ours:
            if ours:
                held.append(place.names("leases/"))
                done.set()

    threads = [threading.Thread(target=wait) for _ in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert held == [["leases/town/k/00000000", "leases/town/k/00000001"]]
    assert "dead" in told
    assert place.names("leases/") == []


def test_who_waits_stops_when_it_is_made(bucket: str, hasty: None) -> None:
    place = Bucket(bucket)
    place.create("leases/town/k/00000000", b'{"host": "busy"}')
    with lease(place, "town/k", lambda: True, lambda host: None) as ours:
        assert not ours


def test_a_store_that_is_away_is_waited_for(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    monkeypatch.setattr(bucket_module, "_PAUSE_S", 0.2)
    with s3_service() as address:
        for name, value in {**KEYS, "AWS_ENDPOINT_URL": address, "AUG3D_STORE": "s3://photographs/away"}.items():
            monkeypatch.setenv(name, value)
        store = Store(tmp_path)
    with s3_service_later(address, 3.0):
        assert commit(store).key == "k1"
    assert "does not answer; waiting" in caplog.text
    monkeypatch.setattr(bucket_module, "PATIENCE_S", 1.0)
    with pytest.raises(StoreError, match="s3://photographs/away cannot be used") as caught:
        commit(store, key="k2")
    assert not any(secret in f"{caught.value} {caplog.text}" for secret in (KEYS["AWS_SECRET_ACCESS_KEY"], "tester"))


class Moody(BaseHTTPRequestHandler):
    """A service that says what it was told to, one status for each request, and then that there is nothing."""

    statuses: ClassVar[list[int]] = []

    def do_GET(self) -> None:
        self.send_response(self.statuses.pop(0) if self.statuses else 404)
        self.send_header("Content-Length", "0")
        self.end_headers()

    def log_message(self, *_: object) -> None:
        pass


@pytest.mark.parametrize(
    ("status", "ends"), [(503, None), (429, None), (400, "cannot be used"), (403, "does not let us in")]
)
def test_a_busy_service_is_asked_again_and_one_that_refuses_is_not(
    status: int, ends: str | None, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(bucket_module, "_PAUSE_S", 0.1)
    with HTTPServer(("127.0.0.1", 0), Moody) as service:
        threading.Thread(target=service.serve_forever, daemon=True).start()
        for name, value in {**KEYS, "AWS_ENDPOINT_URL": f"http://127.0.0.1:{service.server_port}"}.items():
            monkeypatch.setenv(name, value)
        monkeypatch.setattr(Moody, "statuses", [status] * 6)
        with nullcontext() if ends is None else pytest.raises(StoreError, match=ends):
            assert Bucket("s3://bucket").get("name") is None
        assert bool(Moody.statuses) == (ends is not None)
        service.shutdown()


class s3_service_later:
    """An S3 service that begins to answer after a while."""

    def __init__(self, address: str, after_s: float) -> None:
        self.port, self.after_s, self.end = int(address.rpartition(":")[2]), after_s, threading.Event()
        self.thread = threading.Thread(target=self._serve)

    def _serve(self) -> None:
        threading.Event().wait(self.after_s)
        with s3_service(self.port):
            self.end.wait()

    def __enter__(self) -> None:
        self.thread.start()

    def __exit__(self, *_: object) -> None:
        self.end.set()
        self.thread.join()


@pytest.mark.parametrize("url", ["", "s3:///x", "https://b/x", "s3://key:secret@b/x", "s3://b/x?y", "/a/folder"])
def test_an_address_that_is_no_bucket_is_refused_without_its_secrets(url: str) -> None:
    with pytest.raises(StoreError.__mro__[1]) as caught:
        Bucket(url)
    assert "s3://BUCKET/PREFIX" in str(caught.value) and "secret@" not in str(caught.value)


def test_a_bucket_that_is_not_there_is_told_before_anything_is_made(
    tmp_path: Path, bucket: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("AUG3D_STORE", "s3://no-such-bucket/x")
    for ask in (lambda: Store(tmp_path).find("photos", "k1"), lambda: versions(Store(tmp_path), "hill")):
        with pytest.raises(StoreError, match="there is no bucket of the store s3://no-such-bucket/x"):
            ask()


def test_work_that_never_got_a_record_is_not_seen(tmp_path: Path, shared: str) -> None:
    """Blobs first: a maker that dies before its record leaves nothing that counts, and the next one uses them."""
    place = Bucket(shared)
    made = commit(Store(tmp_path / "maker"))
    place.delete([f"objects/photos/k1/{layout.RECORD}"])
    other = Store(tmp_path / "other")
    assert other.find("photos", "k1") is None
    assert commit(other) == made.model_copy(update={"files": other.find("photos", "k1").files})  # type: ignore[union-attr]
    assert (other.object_dir("photos", "k1") / FILES / "sub" / "a.txt").exists()


def a_version(store: Store, scene: str, **told: object) -> Path:
    version = new_version(store, scene)
    (version / layout.REPORT).write_text("<p>a report")
    write_metrics(version, {"scene": scene, "state": "ok", **told})
    share_version(store, version, [])
    return version


def test_one_look_at_the_versions_is_enough_for_a_command(tmp_path: Path, shared: str) -> None:
    maker, other = Store(tmp_path / "maker"), Store(tmp_path / "other")
    for scene in ("hill", "vale", "hill"):
        publish(maker, a_version(maker, scene))
    before = other.traffic()
    assert scenes(other) == ["hill", "vale"]
    assert [len(versions(other, scene)) for scene in ("hill", "vale", "hill")] == [2, 1, 2]
    asked = other.traffic().since(before)
    assert asked.requests == {"list": 1, "get": 3 + 2}, "the figures of each version, what is published, and no report"
    a_version(maker, "vale")
    assert len(versions(other, "vale")) == 1
    bring_versions(other, "vale")
    assert len(versions(other, "vale")) == 2
    before = other.traffic()
    bring_versions(other)
    asked = other.traffic().since(before)
    assert (asked.requests, asked.bytes_down) == ({"list": 1}, 0), "what is here already is not asked for"


def test_what_was_asked_is_counted_to_the_byte(tmp_path: Path, shared: str) -> None:
    maker, other = Store(tmp_path / "maker"), Store(tmp_path / "other")
    before = maker.traffic()
    made = commit(maker)
    size = made.size_bytes
    log = (maker.object_dir("photos", "k1") / LOG).stat().st_size
    put = maker.traffic().since(before)
    record = (maker.object_dir("photos", "k1") / layout.RECORD).stat().st_size
    assert put.requests == {"head": 1, "put": 3, "list": 1}, "blob, log, record; and a look at the marks"
    assert (put.bytes_up, put.bytes_down) == (size + log + record, 0)
    before = other.traffic()
    assert other.find("photos", "k1") == made
    assert other.traffic().since(before).bytes_down == record
    before = other.traffic()
    read(other, made)
    asked = other.traffic().since(before)
    assert (asked.requests, asked.bytes_down) == ({"get": len(made.files)}, size)
    before = other.traffic()
    read(other, made)
    assert other.traffic().since(before).told() == {"requests": {}, "mib_up": 0.0, "mib_down": 0.0}


def test_a_large_file_goes_up_in_parts_that_are_counted(tmp_path: Path, bucket: str) -> None:
    place, file = Bucket(bucket), tmp_path / "large"
    file.write_bytes(bytes(11 * 2**20))
    place.put("large", file)
    assert place.tally.traffic().requests == {"put": 1 + 3 + 1} and place.tally.traffic().bytes_up == 11 * 2**20
    assert place.download("large", tmp_path / "again") and (tmp_path / "again").stat().st_size == 11 * 2**20


def test_lists_and_deletes_of_more_than_a_page_are_counted(bucket: str) -> None:
    place = Bucket(bucket)
    assert place.names("") == [] and place.tally.traffic().requests == {"list": 1}
    place.delete([f"name{number}" for number in range(1001)])
    assert place.tally.traffic().requests["delete"] == 2


def test_one_file_is_read_alone(tmp_path: Path, shared: str) -> None:
    work = (maker := Store(tmp_path / "maker")).work_dir("photos", "k1")
    (work / FILES).mkdir(parents=True)
    for name in ("a.txt", "b.txt"):
        (work / FILES / name).write_text(name)
    made = maker.commit(work, "photos", "k1", dict(FIELDS))
    other = Store(tmp_path / "other")
    assert other.file(made, "b.txt").read_text() == "b.txt"
    assert not (other.place(made) / "a.txt").exists()
