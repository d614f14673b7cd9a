"""The leak audit finds every way in which a test photograph can reach training, and measures what training saw of the test."""

import json
from dataclasses import replace

import numpy as np
import pytest
from scipy import sparse

from aug3d_core.dataset.leaks import Check, Sight, audit, report
from aug3d_core.dataset.scene import RENDERED, SPLITS, Scene
from tests.toy_scene import toy_scene


@pytest.fixture(scope="module")
def scene() -> Scene:
    return toy_scene(0, 12, 8)


def photos(scene: Scene, *roles: str) -> list[int]:
    return [int(p) for p, s in zip(scene.photo_id, scene.splits, strict=True) if p >= 0 and SPLITS[s] in roles]


def sources(scene: Scene) -> dict[str, list[int]]:
    return {"mesh": photos(scene, "train"), "baseline": photos(scene, "train", "gap", "support")}


def sight(scene: Scene, footprint: float = 10.0, seen: float = 10.0) -> Sight:
    """Let each of the 36 photographs look straight ahead at the ground, and see what lies within `seen` of there."""
    origin, ahead = scene.world_from_cam[:36, :3, 3], scene.world_from_cam[:36, :3, 2]
    look = (origin - ahead * (origin[:, 2:] / ahead[:, 2:]))[:, :2]
    points = np.stack(np.meshgrid(*[np.linspace(-40, 40, 81)] * 2), axis=-1).reshape(-1, 2)
    visible = np.linalg.norm(look[:, None] - points, axis=-1) < seen
    return Sight(look, np.full(36, footprint), sparse.csr_array(visible.astype(np.int32)))


def checks(scene: Scene, sources_: dict[str, list[int]] | None = None, sight_: Sight | None = None) -> dict[str, Check]:
    found = audit(scene, sources_ or sources(scene), sight_ or sight(scene))
    return {check.metric: check for check in found}


def sentences(scene: Scene, sources_: dict[str, list[int]] | None = None) -> list[str]:
    return [sentence for check in checks(scene, sources_).values() for sentence in check.found]


def grouped(scene: Scene, name: str, row: int, column: int, view: int) -> Scene:
    members = scene.groups[name].copy()
    members[row, column] = view
    return replace(scene, groups=scene.groups | {name: members})


def view_of(scene: Scene, role: str) -> int:
    return int(np.flatnonzero(scene.splits == SPLITS.index(role))[0])


def test_an_honest_scene_passes_every_check(scene: Scene) -> None:
    found = checks(scene)
    assert all(check.passed for check in found.values()), found
    assert sentences(scene) == []


@pytest.mark.parametrize("name", ["real", "rendered"])
@pytest.mark.parametrize("role", ["gap", "support", "target"])
def test_a_test_photo_in_a_training_group_leaks(scene: Scene, name: str, role: str) -> None:
    view = view_of(scene, role)
    leaking = grouped(scene, name, 2, 1, view)
    assert f"training group set {name} holds {role} view {view}" in sentences(leaking)
    assert not checks(leaking)["leak_training_photos"].passed


def test_a_target_among_the_inputs_of_another_leaks(scene: Scene) -> None:
    leaking = grouped(scene, "test", 0, 1, int(scene.groups["test"][1, 0]))
    assert any("test input" in leak for leak in sentences(leaking))


def test_a_training_photo_as_a_target_leaks(scene: Scene) -> None:
    assert any("is train, not target" in leak for leak in sentences(grouped(scene, "test", 0, 0, 0)))


def test_a_rendered_view_in_a_test_group_leaks(scene: Scene) -> None:
    view = int(np.flatnonzero(scene.source == RENDERED)[0])
    assert f"test group holds rendered view {view}" in sentences(grouped(scene, "test", 0, 2, view))


def test_one_photo_under_two_roles_leaks(scene: Scene) -> None:
    ids = scene.photo_id.copy()
    target = int(scene.groups["test"][0, 0])
    ids[scene.groups["real"][0, 0]] = ids[target]
    assert f"photo {target} is in training and in test" in sentences(replace(scene, photo_id=ids))


@pytest.mark.parametrize("role", ["gap", "support", "target"])
def test_a_test_photo_in_the_mesh_of_train_photos_leaks(scene: Scene, role: str) -> None:
    wrong = photos(scene, role)[0]
    made_of = sources(scene) | {"mesh": [*photos(scene, "train"), wrong]}
    assert sentences(scene, made_of) == [f"the mesh of train photos was made of {role} photo {wrong}"]


def test_a_target_in_the_baseline_mesh_or_a_photo_nobody_knows_leaks(scene: Scene) -> None:
    target = photos(scene, "target")[0]
    found = sentences(scene, {"mesh": [], "baseline": [target, 10**6]})
    assert [sentence.rpartition(" of ")[2] for sentence in found] == [f"target photo {target}", "unknown photo 1000000"]


def test_training_that_looks_too_near_to_a_target_is_told(scene: Scene) -> None:
    near, far = checks(scene, sight_=sight(scene, footprint=40.0)), checks(scene, sight_=sight(scene, footprint=10.0))
    assert not near["leak_gap_footprints_min"].passed and far["leak_gap_footprints_min"].passed
    assert far["leak_gap_footprints_min"].figure == pytest.approx(4 * near["leak_gap_footprints_min"].figure, rel=1e-3)
    assert far["leak_gap_footprints_median"].figure >= far["leak_gap_footprints_min"].figure


def test_training_that_sees_the_test_is_told(scene: Scene) -> None:
    blind, sharp = checks(scene, sight_=sight(scene, seen=8.0)), checks(scene, sight_=sight(scene, seen=200.0))
    assert blind["leak_seen_share_max"].figure == 0
    assert sharp["leak_seen_share_mean"].figure == sharp["leak_seen_share_max"].figure == 1
    assert not sharp["leak_seen_share_mean"].passed and not sharp["leak_seen_share_max"].passed


def test_targets_that_see_nothing_count_as_seen_by_training(scene: Scene) -> None:
    eyes = sight(scene)
    look = eyes.look_in_world.copy()
    look[scene.groups["test"][:, 0]] = np.nan
    found = checks(scene, sight_=replace(eyes, look_in_world=look))
    assert found["leak_gap_footprints_min"].figure == 0 and found["leak_seen_share_max"].figure == 1


def test_the_report_is_json_that_lists_every_photo_and_check(scene: Scene) -> None:
    found = audit(scene, sources(scene), sight(scene))
    told = json.loads(json.dumps(report(found, scene, sources(scene))))
    assert told["state"] == "pass" and len(told["checks"]) == len(found)
    assert sorted(photo for role in told["photos"].values() for photo in role) == list(range(36))
    assert told["made_of"] == sources(scene)
    doubtful = audit(scene, sources(scene), sight(scene, footprint=60.0))
    assert report(doubtful, scene, sources(scene))["state"] == "doubtful"
