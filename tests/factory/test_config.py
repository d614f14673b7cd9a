"""Settings of a scene: presets, overrides by path, and the head that training has."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Mapping
from typing import Any

import pytest

from aug3d_core.factory.config import (
    GONE,
    PRESETS,
    SceneConfig,
    left_open,
    overridden,
    place,
    scene_config,
    validated_config,
    with_settings,
)
from aug3d_core.heads.config import DEFAULT, names
from aug3d_core.run.errors import UsageError
from aug3d_core.run.nested import flat
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
        ("evaluation.seed=3", "there is no setting evaluation.seed any more nothing is random there"),
        (
            "grouping.k=Auto",
            "grouping.k='Auto': input should be a valid integer, unable to parse string as an integer, or ",
        ),
        ("sampling.min_elevation_deg=89", "sampling: min_elevation_deg 89 is above max_elevation_deg 88"),
        ("training.steps=yes", "training.steps='yes': input should be a valid integer"),
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


def test_a_fold_that_there_is_not_is_refused_at_once() -> None:
    with pytest.raises(UsageError, match="grouping: there is no fold 2: folds is 2, and they are counted from 0"):
        scene_config("tiny", ["grouping.folds=2", "grouping.fold=2"])
    assert scene_config("tiny", ["grouping.fold=2"]).grouping.fold == 2, "how many there are is not known yet"


def numbers() -> Iterator[tuple[str, Mapping[str, Any]]]:
    """Yield each setting that takes a number, with what the form knows of it: type, bounds, description."""
    schema = SceneConfig.model_json_schema()

    def below(path: str, one: Mapping[str, Any]) -> Iterator[tuple[str, Mapping[str, Any]]]:
        for choice in one.get("anyOf", [one]):
            if choice.get("type") in ("integer", "number"):
                yield path, {"description": one["description"]} | choice
            elif "$ref" in choice:
                model = schema["$defs"][choice["$ref"].rpartition("/")[2]].get("properties", {})
                head = model.get("name", {}).get("const", "") if path == "training.head" else ""
                for name, field in model.items():
                    yield from ((f"{head}:{at}" if head else at, it) for at, it in below(f"{path}.{name}", field))

    for stage, field in schema["properties"].items():
        yield from below(stage, field)


NUMBERS = dict(numbers())


def refusal(name: str, value: Any) -> str:
    """Return what is said of a value of a setting, `stage.field` or `head:training.head.field`."""
    head, _, path = name.rpartition(":")
    stage, *names = path.split(".")
    settings: Any = value
    for one in reversed(names):
        settings = {one: settings}
    if head:
        settings["head"]["name"] = head
    with pytest.raises(UsageError) as caught:
        validated_config(with_settings("tiny", {stage: settings}))
    assert f"{path}={value!r}: " in caught.value.problem
    return caught.value.problem


@pytest.mark.parametrize("name", NUMBERS)
def test_a_number_out_of_bounds_is_refused_by_its_name(name: str) -> None:
    bounds = NUMBERS[name]
    step = 1 if bounds["type"] == "integer" else 1e-6
    assert {"minimum", "exclusiveMinimum"} & bounds.keys()
    if "minimum" in bounds:
        refusal(name, bounds["minimum"] - step)
    if "exclusiveMinimum" in bounds:
        refusal(name, bounds["exclusiveMinimum"])
    if "maximum" in bounds:
        refusal(name, bounds["maximum"] + step)
    if "exclusiveMaximum" in bounds:
        refusal(name, bounds["exclusiveMaximum"])


@pytest.mark.parametrize("name", NUMBERS)
def test_what_is_no_finite_number_is_none(name: str) -> None:
    assert "cannot be true or false" in refusal(name, True) and "cannot be true or false" in refusal(name, False)
    for value in (math.nan, math.inf, "nan", "-inf"):
        refusal(name, value)


def test_what_is_gone_is_no_setting() -> None:
    values = flat(scene_config("tiny").model_dump())
    assert GONE and not GONE.keys() & values.keys()


_NO_UNIT = ("seed", "first_octave", "fold")  # names of something, not amounts


@pytest.mark.parametrize("name", [name for name in NUMBERS if not name.endswith(_NO_UNIT)])
def test_a_number_has_a_unit_in_brackets(name: str) -> None:
    assert re.search(r"\[[^\]]+\]", NUMBERS[name]["description"])
