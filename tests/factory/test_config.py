"""Settings of a scene: presets, overrides by path, and the head that training has."""

from __future__ import annotations

import pytest

from aug3d_core.factory.config import (
    PRESETS,
    left_open,
    overridden,
    place,
    scene_config,
    validated_config,
    with_settings,
)
from aug3d_core.heads.config import DEFAULT, names
from aug3d_core.run.errors import UsageError
from aug3d_core.scene_files.entry import SceneEntry
from aug3d_core.training.config import presets


def test_an_override_reaches_the_settings_of_the_head_and_leaves_the_rest() -> None:
    usual, changed = (scene_config("small", words).training for words in ([], ["training.head.planes=24"]))
    assert changed.head.planes == 24
    assert changed.model_copy(update={"head": usual.head}) == usual
    assert changed.head.model_copy(update={"planes": usual.head.planes}) == usual.head


@pytest.mark.parametrize(
    ("override", "said"),
    [
        ("training.head=nothing", "there is no head 'nothing'"),
        ("training.head.name=../other", "there is no head"),
        ("training.head.width=3", "training.head has no field 'width'"),
        ("training.planes=8", "did you mean training.head.planes?"),
        ("training.head.hidden=32", "set training.head=pixelnerf first"),
        ("training.head.planes=3", "training.head.planes='3': input should be greater than or equal to 4"),
        ("training.steps.more=3", "training.steps has no field 'more'"),
        ("training.head", "not of the form"),
    ],
)
def test_a_wrong_override_is_named(override: str, said: str) -> None:
    with pytest.raises(UsageError) as caught:
        scene_config("tiny", [override])
    assert said in f"{caught.value.problem} {caught.value.remedy}"


@pytest.mark.parametrize("name", names())
def test_a_head_is_chosen_by_its_name_and_keeps_what_was_set_of_it(name: str) -> None:
    chosen = scene_config("tiny", [f"training.head={name}", "training.steps=7", f"training.head={name}"])
    assert chosen.training.head.name == name and chosen.training.steps == 7
    assert overridden(chosen, []) == chosen


def test_settings_of_a_file_may_name_one_field_of_the_head() -> None:
    entry = SceneEntry(photos=None, settings={"training": {"head": {"planes": 24}, "steps": 9}})
    assert entry.config() == scene_config("tiny", ["training.head.planes=24", "training.steps=9"])
    by_name = SceneEntry(photos=None, settings={"training": {"head": "pixelnerf"}})
    assert by_name.config() == scene_config("tiny", ["training.head=pixelnerf"])


def test_the_preset_paper_has_the_papers_model_and_the_others_the_usual_one() -> None:
    of_presets = {preset: scene_config(preset).training.head.name for preset in PRESETS}
    assert of_presets.pop("paper") == "pixelnerf" and set(of_presets.values()) == {DEFAULT}
    assert scene_config("paper", [f"training.head={DEFAULT}"]).training == presets(DEFAULT)["paper"]


def test_what_is_set_of_a_head_is_not_left_open() -> None:
    config = validated_config(with_settings("auto", {"training": {"head": {"name": "pixelnerf", "hidden": 128}}}))
    assert "training.head.hidden" not in config.auto and "head.hidden" not in left_open(config, "training")
    assert "head.coarse_samples" in left_open(config, "training")


def test_a_wrong_setting_of_the_head_has_the_path_that_users_write() -> None:
    assert place(("training", "head", "pixelnerf", "hidden")) == ("training", "head", "hidden")
    assert place(("photos", "max_px")) == ("photos", "max_px")
