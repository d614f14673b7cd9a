"""What is made of a collection: only what changed, whatever fails elsewhere, and never a held-out scene in training."""

from __future__ import annotations

from pathlib import Path

import pytest

from aug3d_core.collections.entry import CollectionEntry
from aug3d_core.collections.flights import near_share, overlapping
from aug3d_core.collections.made import HOLD_OUT, TOWN, TRAIN, make_collection
from aug3d_core.collections.page import report
from aug3d_core.collections.versions import collection_metrics
from aug3d_core.factory.material import Elsewhere
from aug3d_core.run.errors import InputError, StageFailed
from aug3d_core.scene_files import SceneEntry
from aug3d_core.store.store import Store
from tests.collections.stand_in import Stages


def town(seed: int) -> SceneEntry:
    return SceneEntry(photos=None, settings={"town": {"seed": seed}})


SCENES = {"north": town(1), "south": town(2), "far": town(3)}
ENTRY = CollectionEntry(train=("north", "south"), hold_out=("far",), towns=2)


@pytest.fixture
def store(tmp_path: Path) -> Store:
    return Store(tmp_path)


@pytest.fixture
def stages() -> Stages:
    return Stages()


def made(store, stages, entry=ENTRY, scenes=SCENES):
    return make_collection(store, entry, scenes, lambda of: stages.maker(store))


def test_one_training_over_what_is_trained_on_and_no_held_out_scene(store, stages):
    found = made(store, stages)
    assert stages.given["training"] == {"north", "south", "town-0-00000", "town-0-00001"}
    assert {name: member.role for name, member in found.members.items()} == {
        "north": TRAIN, "south": TRAIN, "far": HOLD_OUT, "town-0-00000": TOWN, "town-0-00001": TOWN,
    }  # fmt: skip
    assert set(found.evaluations) == {"north", "south", "far"}
    assert stages.computed.count("training") == 1


def test_what_a_scene_is_made_of_may_come_from_elsewhere(store, stages):
    told = Elsewhere(photos="as read there", photo_count=1)
    photographed = SCENES | {"south": SceneEntry(photos=store.root / "far away")}
    assert "far away" in made(store, stages, scenes=photographed).members["south"].trouble
    asked = []

    def material_of(name, entry):
        asked.append(name)
        return entry.material(told if entry.photos else None)

    found = make_collection(store, ENTRY, photographed, lambda of: stages.maker(store), material_of=material_of)
    assert found.members["south"].data and asked == ["north", "south", "far"]


def test_nothing_is_made_twice_and_only_what_changed(store, stages):
    first = made(store, stages)
    stages.computed.clear()
    assert made(store, stages).records == first.records
    assert stages.computed == []
    walked = {stage for stage, _ in first.objects}
    assert {"town", "photos", "sfm", "dataset", "training", "evaluation"} <= walked, "or `aug3d gc` would drop them"
    made(store, stages, scenes=SCENES | {"south": town(9)})
    assert stages.computed.count("dataset") == 1 and stages.computed.count("training") == 1


def test_more_towns_leave_those_there_are(store, stages):
    made(store, stages)
    stages.computed.clear()
    made(store, stages, ENTRY.model_copy(update={"towns": 3}))
    assert stages.computed.count("exact_town") == 1


def test_a_scene_that_fails_does_not_stop_the_others(store, stages):
    stages.fails = lambda stage, made: "error: no luck" if stage == "sfm" and made["town"]["seed"] == 2 else ""
    found = made(store, stages)
    assert found.members["south"].trouble.endswith("error: no luck")
    assert stages.given["training"] == {"north", "town-0-00000", "town-0-00001"}
    assert set(found.evaluations) == {"north", "far"}


@pytest.mark.parametrize(
    ("scenes", "told"),
    [
        ({"north": town(1), "far": town(3)}, "'south' is not in the registry"),
        (SCENES | {"south": InputError("south.yaml:3: wrong", "mend it")}, "south.yaml:3: wrong"),
        (SCENES | {"south": SceneEntry(photos=Path("/nowhere"))}, "folder /nowhere does not exist"),
    ],
)
def test_a_scene_that_cannot_be_read_is_told_and_left_out(store, stages, scenes, told):
    found = made(store, stages, scenes=scenes)
    assert told in found.members["south"].trouble and found.members["south"].remedy
    assert set(found.evaluations) == {"north", "far"}


def test_with_nothing_left_to_train_on_the_first_trouble_is_raised(store, stages):
    stages.fails = lambda stage, made: "error: no luck" if stage in ("sfm", "exact_town") else ""
    with pytest.raises(InputError, match=r"no data set is left to train on; north: .*no luck"):
        made(store, stages)


def test_a_small_scene_is_judged_on_nothing_that_the_model_was_trained_on(store, stages):
    stages.folds = 3
    found = made(store, stages, CollectionEntry(train=("north",), hold_out=("far",)))
    assert stages.given["training"] == {"north"}
    assert set(found.evaluations) == {"north", "far", "far_fold1", "far_fold2"}


def test_a_scene_without_a_test_is_trained_on_and_not_judged(store, stages):
    stages.tested = 0
    found = made(store, stages)
    assert not found.evaluations
    assert found.troubles["far"] == "its data set has no test"


def test_a_failed_evaluation_is_told(store, stages):
    stages.fails = lambda stage, made: (
        "crash: gone" if stage == "evaluation" and "evaluation" in stages.computed else ""
    )
    found = made(store, stages, CollectionEntry(train=("north",), hold_out=("far",)))
    assert found.troubles["far"].endswith("crash: gone")
    assert set(found.evaluations) == {"north"}


def test_a_failed_training_is_raised(store, stages):
    stages.fails = lambda stage, made: "error: diverged" if stage == "training" else ""
    with pytest.raises(StageFailed, match="diverged"):
        made(store, stages)


def test_the_page_and_the_figures_name_every_scene(store, stages):
    stages.fails = lambda stage, made: "error: no luck" if stage == "sfm" and made["town"]["seed"] == 2 else ""
    found = made(store, stages)
    metrics = collection_metrics("all", found, ["a note"], "abc", 3.0)
    assert metrics["state"] == "degraded"
    assert metrics["tests"]["far"]["role"] == HOLD_OUT and "no luck" in metrics["scenes"]["south"]["trouble"]
    page = report(store, metrics, found)
    assert all(
        text in page for text in ("never seen", "trained on", "error: no luck", "a note", "2 of them made-up towns")
    )


def test_the_same_photographs_in_two_scenes_are_told(store, stages):
    found = made(store, stages, CollectionEntry(train=("north",), hold_out=("far",)), SCENES | {"far": town(1)})
    notes = overlapping(store, found.members)
    assert notes == ["9 photographs are in both far and north: a test of one was trained on in the other"]
    assert overlapping(store, made(store, stages).members) == [], "towns all claim one position"


def test_flights_over_the_same_ground_are_found_by_position():
    import pandas as pd

    one = pd.DataFrame({"lat_deg": [54.0, 54.001, 54.002], "lon_deg": 18.0})  # 111 m apart
    beside = one.assign(lon_deg=18.0005)  # 33 m
    far = one.assign(lat_deg=one["lat_deg"] + 1)
    assert near_share(one, beside) == 1
    assert near_share(one, far) == 0
    assert near_share(one, one.assign(lat_deg=float("nan"))) == 0
