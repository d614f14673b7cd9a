"""A damaged object is made again from its job, and from inputs that are whole."""

from __future__ import annotations

from pathlib import Path

import pytest

from aug3d_core.factory.build import build
from aug3d_core.factory.config import scene_config
from aug3d_core.factory.material import Material
from aug3d_core.factory.repair import repair
from aug3d_core.factory.stages import MATCHING, PHOTOS
from aug3d_core.factory.walk import Visit, walk
from aug3d_core.photos.files import PHOTO_TABLE
from aug3d_core.run.errors import StoreError
from aug3d_core.run.files import JOB
from aug3d_core.store.record import Record, read_job
from aug3d_core.store.seal import sealed
from aug3d_core.store.store import Store
from tests.photos.photo_files import write_photo
from tests.tests_support import flip

STAGES = (PHOTOS, MATCHING)


def quiet(*_: object) -> None:
    pass


@pytest.fixture
def made(tmp_path: Path) -> tuple[Store, dict[str, Record]]:
    """Return a store with photographs and matches, of the real stages."""
    for seed in range(4):
        write_photo(tmp_path / "photos" / f"{seed}.png", seed=seed)
    store = Store(tmp_path / "home")

    def make(visit: Visit):
        assert visit.work
        return build(store, visit.work, quiet)

    config, material = scene_config("tiny"), Material(photos=tmp_path / "photos")
    return store, {
        visit.step.name: visit.built.record for visit in walk(store, STAGES, config, material, make) if visit.built
    }


@pytest.mark.slow
def test_an_object_and_its_inputs_are_made_again_to_the_bit(made: tuple[Store, dict[str, Record]]) -> None:
    store, records = made
    flip(store.place(records["photos"]) / PHOTO_TABLE)
    flip(store.place(records["matching"]) / sorted(records["matching"].files)[0])
    built = repair(store, ("matching", records["matching"].key), quiet)
    assert built.record.digest == records["matching"].digest
    assert "byte for byte the same" in built.damage
    for stage, record in records.items():
        again = store.find(stage, record.key)
        assert again and again.digest == record.digest and not store.faults(again)


@pytest.mark.slow
@pytest.mark.parametrize("what", ["job", "photographs", "settings"])
def test_what_cannot_be_made_as_it_was_is_put_aside_and_says_why(
    made: tuple[Store, dict[str, Record]], tmp_path: Path, what: str
) -> None:
    store, records = made
    photos = records["photos"]
    flip(store.place(photos) / PHOTO_TABLE)
    if what == "job":
        flip(store.object_dir("photos", photos.key) / JOB)
    elif what == "settings":  # an earlier version had others
        file = store.object_dir("photos", photos.key) / JOB
        job = read_job(file)
        file.write_bytes(sealed(job | {"config": job["config"] | {"least_sharpness": 0.5}}))
    else:
        write_photo(tmp_path / "photos" / "9.png", seed=9)
    with pytest.raises(
        StoreError, match="was made of is not known" if what == "job" else "cannot be made as it was"
    ) as error:
        repair(store, ("photos", photos.key), quiet)
    assert "run the scene again" in error.value.remedy
    assert store.find("photos", photos.key) is None
    assert len(list((store.root / "objects" / "photos").glob(".damaged-*"))) == 1
