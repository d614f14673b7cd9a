"""One flipped bit in every file of a store in turn, size and time kept: each is named, and made again where it can be."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from aug3d_core.factory.build import build
from aug3d_core.factory.config import scene_config
from aug3d_core.factory.material import Material
from aug3d_core.factory.repair import repair
from aug3d_core.factory.stages import MATCHING, PHOTOS
from aug3d_core.factory.walk import Visit, walk
from aug3d_core.run.files import LOG
from aug3d_core.store import layout
from aug3d_core.store.published import publish
from aug3d_core.store.record import Record
from aug3d_core.store.scenes import new_version, write_metrics
from aug3d_core.store.store import Store
from aug3d_core.store.verification import damaged, items_of
from tests.photos.photo_files import write_photo
from tests.tests_support import flip, rot

HARMLESS = {LOG}  # for people; nothing reads it


@pytest.mark.slow
@pytest.mark.attack
def test_a_flipped_bit_in_any_file_is_named_and_the_object_made_again(tmp_path: Path) -> None:
    for seed in range(4):
        write_photo(tmp_path / "photos" / f"{seed}.png", seed=seed)
    store, rng = Store(tmp_path / "home"), np.random.default_rng(22)
    records = made(store, tmp_path / "photos")
    version = new_version(store, "hill")
    (version / layout.REPORT).write_text("a report")
    write_metrics(
        version, {"scene": "hill", "objects": {name: {"stage": r.stage, "key": r.key} for name, r in records.items()}}
    )
    publish(store, version)
    files = [
        path for top in (layout.OBJECTS, layout.SCENES) for path in (store.root / top).rglob("*") if path.is_file()
    ]
    counts = {"named": 0, "harmless": 0}
    for file in sorted(files):
        before = file.read_bytes()
        if not before:
            continue
        flip(file, int(rng.integers(0, 8 * len(before))))
        found = list(damaged(store, None, items_of(store, None), lambda count: None))
        if file.name in HARMLESS:
            assert not found
            counts["harmless"] += 1
        else:
            assert [file.is_relative_to(one.path) for one in found] == [True], file
            counts["named"] += 1
        rot(file, before)
    print(f"\n{counts}")
    assert counts["named"] >= 12
    photos = records["photos"]
    for name in photos.files:
        flip(store.place(photos) / name, 0)
        assert repair(store, ("photos", photos.key), lambda *_: None).record.digest == photos.digest


def made(store: Store, photos: Path) -> dict[str, Record]:
    def make(visit: Visit):
        assert visit.work
        return build(store, visit.work, lambda *_: None)

    visits = walk(store, (PHOTOS, MATCHING), scene_config("tiny"), Material(photos=photos), make)
    return {visit.step.name: visit.built.record for visit in visits if visit.built}
