"""What a person may write into a scene's file, and how each mistake is told: file, line, field."""

from __future__ import annotations

from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from aug3d_core.run.errors import InputError
from aug3d_core.scene_files.check import checked_entry
from aug3d_core.scene_files.entry import SceneEntry

FILE = Path("/home/ann/scenes/hill.yaml")


def refusal(text: str | bytes) -> str:
    with pytest.raises(InputError) as told:
        checked_entry(FILE, text if isinstance(text, bytes) else text.encode())
    return told.value.problem


@pytest.mark.parametrize(
    ("text", "line", "said"),
    [
        ("poses: null", 1, "photos: is missing: Folder of photographs; null is the built-in town."),
        ("photos: null\nphotos: a", 2, "there is photos twice: it is in line 1 already"),
        ("photos: null\nsettings:\n  sfm: {}\n  sfm: {}", 4, "there is settings.sfm twice: it is in line 3 already"),
        ("photos: null\npreset: huge", 2, "preset = 'huge': is not a preset: choose one of tiny, small, paper"),
        ("photos: null\nlicense: BSD", 2, "license: there is no such field, did you mean licence? Known: photos, poses,"),
        ("photos: null\nlicence: 4.0", 2, "licence = 4.0: should be a text: put it in quotes"),
        ("photos: null\ntags: city", 2, "tags = 'city': should be a list: [one, two]"),
        ("photos: null\ntags:\n- a\n- 5", 4, "tags.1 = 5: should be a text"),
        ("photos: null\nposes: /p", 1, "yaml:1: poses are of photographs: name the folder of these, too"),
        ("photos: ''", 1, "photos = '': is no path"),
        ('photos: "a\\0b"', 1, "is no path"),
        ("photos: 5", 1, "photos = 5: should be a path"),
        ("photos: null\nsettings:\n  training:\n    steps: -5", 4, "settings.training.steps = -5: input should be"),
        ("photos: null\nsettings:\n  training:\n    step: 5", 4, "did you mean steps? Known: head, input_views,"),
        ("photos: null\nsettings:\n  grouping:\n    k: x", 4, "grouping.k = 'x': input should be a valid integer, unable to"),
        ("photos: null\nsettings:\n  grouping:\n    k: x", 4, ", or input should be 'auto'"),
        ("photos: null\nsettings:\n  training:\n    steps: yes", 4, "settings.training.steps = True: cannot be true or false"),
        ("photos: null\nsettings:\n  sampling:\n    min_elevation_deg: 89", 3, "settings.sampling: min_elevation_deg 89 is"),
        ("photos: null\nsettings:\n  grouping:\n    folds: 2\n    fold: 2", 3, "settings.grouping: there is no fold 2: "),
        ("photos: null\nsettings:\n  evaluation:\n    seed: 3", 4, "evaluation.seed: there is no such setting any more: "),
        ("photos: null\nsettings:\n  trainign: {}", 3, "did you mean training? Known: town, photos,"),
        ("photos: null\nsettings:\n  auto: {steps: 5}", 2, "auto is no stage: write preset: auto, and here only what it"),
        ("photos: null\nsettings:\n  training: 5", 3, "settings.training = 5: should have fields of its own"),
        ("photos: null\nschedule:\n  cron: 0 25 * * 1", 3, "schedule.cron = '0 25 * * 1': field 2, hour, cannot be '25'"),
        ("photos: null\nschedule:\n  every: 6", 3, "schedule.every = 6: should be a text"),
        ("photos: null\nschedule:\n  timezone: UTC", 2, "schedule: needs cron or every"),
        ("photos: null\nschedule: weekly", 2, "schedule = 'weekly': should have fields of its own"),
        ("photos: null\nschedule:\n  every: 6h\n  evry: 6h", 4, "did you mean every? Known: cron, every, timezone"),
        ("photos: null\npublish:\n  most_psnr_drop_db: -1", 3, "publish.most_psnr_drop_db = -1: input should be"),
        ("photos: null\nschedule:\n  cron: * 3 * * *", 3, "a value that begins with * needs quotes"),
        ("photos: null\n\tposes: a", 2, "indent with spaces, not with tabs"),
        ("photos: null\ndescription: hill: east", 2, "a text with a colon in it needs quotes"),
        ('photos: "a\npreset: tiny\n', 3, "begun in line 1 (a quotation mark is missing)"),
        ("photos: null\ntags: [a\npreset: b", 3, "begun in line 2"),
        ("photos: &a null\nposes: *a", 1, "a reference (& and *) cannot be followed here"),
        ("tags: &a [*a]", 1, "a reference (& and *) cannot be followed here"),
        ("photos: null\n? [a]\n: b", 2, "unhashable key"),
        ("photos: !!python/object:os.system x", 1, "the tag tag:yaml.org,2002:python/object:os.system is not read: leave it"),
        ("photos: null\npreset: 0x_", 2, "invalid literal for int()"),
        ("photos: null\n5: 6", 2, "5 = 5: keys should be strings"),
        ("a: 1\n---\nb: 2", 2, "expected a single document"),
        ("photos: null\nlicence: \x07", 2, r"the character '\x07' cannot stand here"),
        (b"photos: null\nlicence: \xe9t\xe9", 2, "it is not text in UTF-8"),
        ("[" * 600, 1, "nested too deeply"),
        ("- photos", 1, "it holds no fields"),
        ("# nothing but this", 1, "it holds no fields"),
        ("", 1, "it holds no fields"),
    ],
)  # fmt: skip
def test_a_mistake_names_file_line_and_field(text: str | bytes, line: int, said: str) -> None:
    problem = refusal(text)
    assert problem.startswith(f"{FILE}:{line}: ") and said in problem


def test_all_mistakes_are_told_at_once() -> None:
    text = (
        "phtos: a\nschedule: {every: 1w, timezone: Mars}\ntags: [1]\nsettings: {training: {steps: -5}}\npreset: small"
    )
    lines = refusal(text).splitlines()
    numbers = [int(line.removeprefix(f"{FILE}:").partition(":")[0]) for line in lines]
    assert numbers == [1, 1, 2, 2, 3, 4]


def test_what_is_left_empty_is_left_out() -> None:
    text = "photos:\nposes:\npreset:\nsettings:\nlicence:\ndescription:\ntags:\nschedule:\npublish:\n"
    assert checked_entry(FILE, text.encode()) == SceneEntry(photos=None)


def test_what_is_set_is_not_left_to_auto() -> None:
    entry = checked_entry(FILE, b"photos: null\npreset: auto\nsettings:\n  training:\n    steps: 1200\n")
    config = entry.config()
    assert "training.steps" not in config.auto and "training.head.planes" in config.auto
    assert checked_entry(FILE, b"photos: null\npreset: small\n").config().auto == ()


def test_paths_start_at_the_folder_of_the_file(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("HOME", "/home/bob")
    entry = checked_entry(FILE, b"photos: ../photos/hill\nposes: ~/poses")
    assert entry.photos == Path("/home/ann/photos/hill") and entry.poses == Path("/home/bob/poses")
    assert checked_entry(FILE, b"photos: /a/b").photos == Path("/a/b")
    assert checked_entry(FILE, b"photos: ~nobody_here/b").photos == FILE.parent / "~nobody_here/b"


def test_a_byte_order_mark_does_no_harm() -> None:
    assert checked_entry(FILE, "\ufeffphotos: null".encode()) == SceneEntry(photos=None)


@pytest.mark.parametrize("value", ["maybe", "x", "''", "+", "5", "2026-11-25", "[a]", "{a: 1}"])
@pytest.mark.parametrize(
    "tag", ["bool", "int", "float", "null", "timestamp", "str", "binary", "set", "omap", "map", "seq"]
)
def test_a_tag_of_yaml_s_own_is_refused_with_its_line_wherever_it_stands(tag: str, value: str) -> None:
    for text in (f"photos: null\npreset: !!{tag} {value}", f"photos: null\n? !!{tag} {value}\n: 1"):
        assert refusal(text).startswith(f"{FILE}:2: the tag tag:yaml.org,2002:{tag} is not read")


@given(st.text("abphotsgn:-# \n\t*&[]{}'\"!|>?%@,5", max_size=60))
def test_whatever_is_written_is_read_or_refused(text: str) -> None:
    for begin in ("", "photos: null\n", "photos: null\nsettings:\n  "):
        try:
            checked_entry(FILE, (begin + text).encode())
        except InputError as told:
            assert str(FILE) in told.problem
