"""What no version of any machine needs goes from the shared store, in two steps, and never from under a machine at work."""

from __future__ import annotations

import json
from collections.abc import Iterable
from pathlib import Path

import pytest

from aug3d_core.run.errors import StoreError
from aug3d_core.run.files import FILES
from aug3d_core.store import layout, shared
from aug3d_core.store import sweep as sweep_module
from aug3d_core.store.bucket import Bucket, Entry
from aug3d_core.store.census import census
from aug3d_core.store.damage import DamagedError
from aug3d_core.store.published import publish
from aug3d_core.store.record import Record
from aug3d_core.store.scenes import share_version
from aug3d_core.store.store import Store
from aug3d_core.store.sweep import Sweep, look, sweep
from tests.store.little_store import add_object, add_study, add_version

KEYS = [("photos", "a"), ("sfm", "b"), ("training", "d")]
HOURS = 24.0


class ServiceClock:
    """The clock of the service: tests turn it."""

    hours = 100.0

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        put, create, entries = Bucket.put, Bucket.create, Bucket.entries
        at: dict[str, float] = {}

        def timed_put(place: Bucket, name: str, content: bytes | Path) -> None:
            put(place, name, content)
            at[name] = self.hours

        def timed_create(place: Bucket, name: str, content: bytes) -> bool:
            created = create(place, name, content)
            at.setdefault(name, self.hours)
            return created

        def timed(place: Bucket, prefix: str) -> list[Entry]:
            return [entry._replace(modified_s=3600 * at[entry.name]) for entry in entries(place, prefix)]

        monkeypatch.setattr(Bucket, "put", timed_put)
        monkeypatch.setattr(Bucket, "create", timed_create)
        monkeypatch.setattr(Bucket, "entries", timed)


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> ServiceClock:
    monkeypatch.setattr(shared, "_LOOK_S", -1.0)  # a machine sees a mark as soon as it is there
    return ServiceClock(monkeypatch)


@pytest.fixture
def maker(tmp_path: Path, shared: str) -> Store:
    return Store(tmp_path / "maker")


@pytest.fixture
def place(shared: str) -> Bucket:
    return Bucket(shared)


def version(store: Store, scene: str, name: str, objects: Iterable[tuple[str, str]]) -> Path:
    folder = add_version(store, scene, name, objects)
    share_version(store, folder, objects)
    return folder


def swept(place: Bucket, home: Path, keep: int = 3, hours: float = HOURS, scene: str | None = None) -> Sweep:
    return sweep(place, home / "sweeper", keep, hours, scene)


def there(place: Bucket) -> set[tuple[str, str]]:
    return {item for item in KEYS if place.has(f"objects/{'/'.join(item)}/record.json")}


def blobs(place: Bucket) -> set[str]:
    return {name.rpartition("/")[2] for name in place.names("blobs/")}


def digests(*records: Record) -> set[str]:
    return {entry.sha256 for record in records for entry in record.files.values()}


def five_days(clock: ServiceClock, place: Bucket, home: Path, **how: int) -> None:
    for _ in range(5):
        clock.hours += 25
        swept(place, home, **how)


def test_what_no_version_of_any_machine_names_goes_with_its_bytes(
    tmp_path: Path, maker: Store, place: Bucket, clock: ServiceClock
) -> None:
    other = Store(tmp_path / "other")
    needed, studied = add_object(maker, *KEYS[0]), add_object(other, *KEYS[1])
    add_object(maker, *KEYS[2], size_bytes=5000)
    version(maker, "hill", "1", [KEYS[0]])
    study = add_study(other, "vale", "grouping-1", [KEYS[1]])
    assert other.shared
    other.shared.share_study(study)
    five_days(clock, place, tmp_path)
    assert there(place) == set(KEYS[:2]) and blobs(place) == digests(needed, studied)
    assert not list((tmp_path / "sweeper").glob("**/*")), "a machine that made nothing can do it, and keeps nothing"
    leftover = [name for name in place.names("") if name.startswith(("work", "leases", layout.USED))]
    assert leftover == [] and len(place.names(layout.MARKS)) <= 3


def test_it_goes_a_day_after_it_was_seen_and_its_bytes_a_day_after_that(
    tmp_path: Path, maker: Store, place: Bucket, clock: ServiceClock
) -> None:
    made = add_object(maker, *KEYS[0])
    seen = swept(place, tmp_path)
    assert (seen.goes, seen.waits, there(place)) == ((), (), {KEYS[0]}), "what is young is not even marked"
    clock.hours += 25
    seen = swept(place, tmp_path)
    assert seen.goes == () and [each.item for each in seen.waits] == [KEYS[0]]
    clock.hours += 23
    assert swept(place, tmp_path).goes == () and there(place) == {KEYS[0]}
    clock.hours += 2
    assert [each.item for each in swept(place, tmp_path).goes if each.item] == [KEYS[0]]
    assert there(place) == set() and blobs(place) == digests(made), "bytes stay while a record may be put back"
    clock.hours += 25
    swept(place, tmp_path)
    clock.hours += 25
    swept(place, tmp_path)
    assert blobs(place) == set()


def test_an_hour_at_least_lies_between(tmp_path: Path, maker: Store, place: Bucket, clock: ServiceClock) -> None:
    add_object(maker, *KEYS[0])
    clock.hours += 2
    for _ in range(3):
        swept(place, tmp_path, hours=0.0)
    assert there(place) == {KEYS[0]}
    clock.hours += 2
    swept(place, tmp_path, hours=0.0)
    assert there(place) == set()


def test_looking_changes_nothing(tmp_path: Path, maker: Store, place: Bucket, clock: ServiceClock) -> None:
    add_object(maker, *KEYS[0])
    clock.hours += 25
    swept(place, tmp_path)
    clock.hours += 25
    place.put("gc/clock", b"")
    before = place.names("")
    assert [each.item for each in look(census(place, tmp_path), 3, HOURS).goes if each.item] == [KEYS[0]]
    assert place.names("") == before


@pytest.mark.parametrize("use", ["whole", "take", "share_version"])
def test_a_run_that_begins_to_use_what_is_marked_keeps_it(
    use: str, tmp_path: Path, maker: Store, place: Bucket, clock: ServiceClock
) -> None:
    made = add_object(maker, *KEYS[0])
    clock.hours += 25
    swept(place, tmp_path)
    clock.hours += 24
    other = Store(tmp_path / "other")
    if use == "whole":
        assert other.whole(*KEYS[0]) == made
    elif use == "take":
        assert other.take(*KEYS[0]) == (made, "")
    else:
        version(maker, "hill", "1", [KEYS[0]])
    for _ in range(3):
        clock.hours += 7
        swept(place, tmp_path)
    assert there(place) == {KEYS[0]}
    assert (other.files_dir(made) / "small").read_text() == "a"


def test_a_use_that_came_in_the_moment_of_deletion_brings_the_record_back(
    tmp_path: Path, maker: Store, place: Bucket, clock: ServiceClock, monkeypatch: pytest.MonkeyPatch
) -> None:
    made = add_object(maker, *KEYS[0])
    add_object(maker, *KEYS[2])
    clock.hours += 25
    swept(place, tmp_path)
    clock.hours += 25
    other, delete = Store(tmp_path / "other"), Bucket.delete

    def late(self: Bucket, names: list[str]) -> None:
        if f"objects/photos/a/{layout.RECORD}" in names:
            assert other.whole(*KEYS[0]) == made
        delete(self, names)

    monkeypatch.setattr(Bucket, "delete", late)
    swept(place, tmp_path)
    assert there(place) == {KEYS[0]} and (other.files_dir(made) / "small").read_text() == "a"


def test_bytes_that_a_maker_found_while_they_were_to_go_are_put_again(
    tmp_path: Path, maker: Store, place: Bucket, clock: ServiceClock, monkeypatch: pytest.MonkeyPatch
) -> None:
    made = add_object(maker, *KEYS[0])
    place.delete([f"objects/photos/a/{layout.RECORD}"])
    for _ in range(2):
        clock.hours += 25
        swept(place, tmp_path)
    assert blobs(place) == set()
    again = add_object(Store(tmp_path / "other"), *KEYS[0])
    place.delete([f"objects/photos/a/{layout.RECORD}"])
    clock.hours += 25
    swept(place, tmp_path)
    clock.hours += 25
    third, ours = Store(tmp_path / "third"), sweep_module._drop_blobs

    def meanwhile(*arguments):
        assert digests(add_object(third, *KEYS[0])) == digests(made)  # after what may go was settled
        return ours(*arguments)

    monkeypatch.setattr(sweep_module, "_drop_blobs", meanwhile)
    swept(place, tmp_path)
    assert blobs(place) == digests(again) and there(place) == {KEYS[0]}


def test_what_is_being_made_or_was_put_just_now_stays(
    tmp_path: Path, maker: Store, place: Bucket, clock: ServiceClock
) -> None:
    add_object(maker, *KEYS[0])
    place.put("work/sfm/w/raw/1", b"half")
    place.put("work/sfm/dead/raw/1", b"half")
    place.put("leases/sfm/dead/00000000", b"{}")
    for _ in range(4):
        clock.hours += 25
        place.put("leases/sfm/w/00000000", b"{}")  # its owner lives
        place.put("leases/photos/a/00000000", b"{}")
        swept(place, tmp_path)
    assert there(place) == {KEYS[0]}
    assert [name for name in place.names("work/")] == ["work/sfm/w/raw/1"]
    assert place.names("leases/sfm/dead") == []


def test_each_scene_keeps_its_newest_the_published_and_the_newest_whole_version(
    tmp_path: Path, maker: Store, place: Bucket, clock: ServiceClock
) -> None:
    folders = []
    for number in range(5):
        add_object(maker, "sfm", f"k{number}")
        folders.append(version(maker, "hill", f"{number}", [("sfm", f"k{number}")]))
    publish(maker, folders[0])
    assert [each.what for each in swept(place, tmp_path, keep=1).goes] == [], "versions of this hour stay"
    five_days(clock, place, tmp_path, keep=1)
    left = {name.split("/")[2] for name in place.names("scenes/hill/")}
    assert left == {"0", "4", layout.PUBLISHED}
    assert {name.split("/")[2] for name in place.names("objects/")} == {"k0", "k4"}


def test_all_of_a_scene_goes_but_what_others_need(
    tmp_path: Path, maker: Store, place: Bucket, clock: ServiceClock
) -> None:
    for item in KEYS:
        add_object(maker, *item)
    publish(maker, version(maker, "hill", "1", KEYS[:2]))
    version(maker, "vale", "1", [KEYS[1]])
    swept(place, tmp_path, scene="hill")
    assert {name.split("/")[1] for name in place.names("scenes/")} == {"vale"}
    five_days(clock, place, tmp_path)
    assert there(place) == {KEYS[1]}


def test_nothing_goes_while_a_version_or_a_record_cannot_be_read(
    tmp_path: Path, maker: Store, place: Bucket, clock: ServiceClock
) -> None:
    add_object(maker, *KEYS[0])
    clock.hours += 25
    swept(place, tmp_path)
    clock.hours += 25
    for name in ("scenes/hill/1/metrics.json", "objects/sfm/x/record.json"):
        place.put(name, b"{")
        with pytest.raises(StoreError, match=name):
            swept(place, tmp_path)
        place.delete([name])
    assert there(place) == {KEYS[0]}


def test_a_machine_whose_object_went_gives_it_again_or_makes_it_again(
    tmp_path: Path, maker: Store, place: Bucket, clock: ServiceClock
) -> None:
    """The maker has all of it; another machine knows the record alone, and a third has read a file."""
    made = add_object(maker, *KEYS[0])
    knows, reads = Store(tmp_path / "knows"), Store(tmp_path / "reads")
    assert knows.find(*KEYS[0]) == reads.find(*KEYS[0]) == made
    reads.file(made, "small")
    clock.hours += 25
    swept(place, tmp_path)
    clock.hours += 25
    swept(place, tmp_path)
    assert there(place) == set()
    for store in (knows, reads):
        with pytest.raises(DamagedError, match="is no more in the shared store"):
            version(store, "hill", store.root.name, [KEYS[0]])
        assert store.find(*KEYS[0]) is None, "the next run makes it again"
    version(maker, "hill", "1", [KEYS[0]])
    assert there(place) == {KEYS[0]}
    assert (knows.files_dir(made) / FILES).parent.exists() and knows.find(*KEYS[0]) == made


def test_a_reader_of_files_that_went_learns_that_the_next_run_makes_them(
    tmp_path: Path, maker: Store, place: Bucket, clock: ServiceClock
) -> None:
    made, other = add_object(maker, *KEYS[0]), Store(tmp_path / "other")
    assert other.find(*KEYS[0]) == made
    five_days(clock, place, tmp_path)
    with pytest.raises(DamagedError, match="was dropped from the shared store"):
        other.files_dir(made)
    assert other.find(*KEYS[0]) is None
    again = add_object(other, *KEYS[0])
    assert again.digest == made.digest and there(place) == {KEYS[0]}


def test_the_store_tells_what_each_scene_takes(tmp_path: Path, maker: Store, place: Bucket) -> None:
    one, both = add_object(maker, *KEYS[0], size_bytes=3000), add_object(maker, *KEYS[1], size_bytes=7000)
    version(maker, "hill", "1", KEYS[:2])
    version(maker, "vale", "1", [KEYS[1]])
    takes = census(place, tmp_path / "nothing").usage()
    assert takes["hill"].versions == takes["vale"].versions == 1
    assert takes["hill"].own_bytes > one.size_bytes and takes["vale"].own_bytes < 3000
    assert takes["hill"].shared_bytes == takes["vale"].shared_bytes > both.size_bytes
    assert json.loads(place.get("scenes/vale/1/metrics.json") or b"")["scene"] == "vale"
