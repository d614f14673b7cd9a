"""Each thing that can be wrong with a flight is found, and nothing is found in a good one."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from dataclasses import replace
from datetime import timedelta
from pathlib import Path

import numpy as np
import pytest
from PIL import Image, ImageFilter

from aug3d_core.look.findings import Finding, findings_of, verdict_of
from aug3d_core.look.survey import survey_of
from aug3d_core.run.errors import InputError
from tests.look.flown import Shot, lines, take, without


def found(folder: Path) -> list[Finding]:
    return findings_of(survey_of(folder, lambda *_: None))


def test_nothing_is_wrong_with_a_good_flight(tmp_path: Path) -> None:
    findings = found(take(tmp_path, lines(5)))
    assert findings == [] and verdict_of(findings) == "These photographs look good."


def some(*which: int, by: Callable[[Image.Image], Image.Image]) -> Callable[[Shot, Image.Image], Image.Image]:
    names = {f"shot_{i:03d}.jpg" for i in which}
    return lambda shot, picture: by(picture) if shot.name in names else picture


@pytest.mark.parametrize(
    ("words", "weight", "names", "changed"),
    [
        ("less sharp", "warn", (3, 20), some(3, 20, by=lambda p: p.filter(ImageFilter.GaussianBlur(3)))),
        ("brighter or darker", "warn", (4,), some(4, by=lambda p: p.point(lambda v: 0.4 * v))),
        ("as bright as the darkest", "warn", None, some(*range(14), by=lambda p: p.point(lambda v: 0.4 * v))),
        ("white over", "warn", (9,), some(9, by=lambda p: p.point(lambda v: 2 * v))),
    ],
)
def test_pictures_that_differ_are_named(
    tmp_path: Path,
    words: str,
    weight: str,
    names: tuple[int, ...] | None,
    changed: Callable[[Shot, Image.Image], Image.Image],
) -> None:
    [one] = [one for one in found(take(tmp_path, lines(5), changed=changed)) if words in one.what]
    assert one.weight == weight and one.to_do
    if names is not None:
        assert one.names == tuple(f"shot_{i:03d}.jpg" for i in names)


def test_damaged_tiny_and_repeated_files_are_named(tmp_path: Path) -> None:
    folder = take(tmp_path, lines(5))
    (folder / "broken.jpg").write_bytes((folder / "shot_000.jpg").read_bytes()[:900])
    Image.new("L", (20, 20)).save(folder / "icon.png")
    Image.new("L", (500, 300)).save(folder / "map.png")
    shutil.copy(folder / "shot_001.jpg", folder / "shot_zz.jpg")
    unusable, same = found(folder)
    assert unusable.weight == "warn" and set(unusable.names) == {"broken.jpg", "icon.png", "map.png"}
    assert same.weight == "note" and same.names == ("shot_zz.jpg",)


def test_a_flight_of_too_little_overlap_will_not_do(tmp_path: Path) -> None:
    little = found(take(tmp_path / "little", lines(5, along=0.5)))
    assert [one.weight for one in little] == ["warn"] and "overlap by 50%" in little[0].what
    least = found(take(tmp_path / "least", lines(5, along=0.3)))
    assert least[0].weight == "stop" and "will not do" in verdict_of(least)


@pytest.mark.parametrize(
    ("which", "weight", "told"),
    [
        ((), "", ""),
        ((9,), "", ""),  # two steps of 19 touch a place elsewhere
        ((3, 9), "warn", "4 of 19 photographs show nothing of the next one."),
        (tuple(range(1, 14, 2)), "stop", "14 of 19 photographs show nothing of the next one."),
        (tuple(range(20)), "stop", "No photograph shows anything of the next one."),
    ],
)
def test_without_positions_photographs_that_show_nothing_of_the_next_one_are_counted(
    tmp_path: Path, which: tuple[int, ...], weight: str, told: str
) -> None:
    noise = {f"shot_{i:03d}.jpg": i for i in which}

    def elsewhere(shot: Shot, picture: Image.Image) -> Image.Image:
        if shot.name not in noise:
            return picture
        rng = np.random.default_rng(noise[shot.name])
        return Image.fromarray(rng.integers(0, 256, (30, 40), dtype=np.uint8)).resize(picture.size)

    findings = [
        one for one in found(take(tmp_path, lines(5, 4), gps=False, changed=elsewhere)) if "next one" in one.what
    ]
    assert [(one.weight, one.what) for one in findings] == [(weight, told)] * bool(told)


def test_with_positions_the_end_of_a_line_may_show_nothing_of_the_next_one(tmp_path: Path) -> None:
    shots = lines(5, 5)
    northward = [shot for line in range(5) for shot in shots[line * 5 : line * 5 + 5][:: -1 if line % 2 else 1]]
    back = [replace(shot, time=Shot.time + timedelta(seconds=4 * i)) for i, shot in enumerate(northward)]
    survey = survey_of(take(tmp_path, back), lambda *_: None)
    assert (survey.overlaps == 0).sum() == 4 > 0.15 * len(survey.steps) and not survey.lost.any()
    assert not any("next one" in one.what for one in findings_of(survey))


def test_lines_that_lie_too_far_apart_and_parts_that_cannot_be_joined(tmp_path: Path) -> None:
    [far] = found(take(tmp_path / "far", lines(5, across=0.25)))
    assert far.weight == "warn" and "sideways by 2" in far.what
    parts, *_ = found(take(tmp_path / "parts", [*without(lines(9, across=0.6), 3, 4, 5)]))
    assert "falls into 2 parts" in parts.what and len(parts.names) == 24


def test_ground_that_was_left_out_is_told_with_its_size(tmp_path: Path) -> None:
    shots = [*without(lines(9, across=0.7), 3, 4, 5)]
    [gap] = [one for one in found(take(tmp_path, shots)) if "fewer than three" in one.what]
    assert gap.weight == "warn" and "m2" in gap.what


def test_positions_times_and_flights(tmp_path: Path) -> None:
    shots = lines(5)
    wild = [replace(shot, told_m=(0.0, 3000.0)) if i == 12 else shot for i, shot in enumerate(shots)]
    [one] = found(take(tmp_path / "wild", wild))
    assert (one.weight, one.names) == ("warn", ("shot_012.jpg",)) and "cannot be right" in one.what
    lost = [replace(shot, told_m=(9000.0 * (i // 2), 0.0)) for i, shot in enumerate(lines(1, 4))]
    assert not any("cannot be right" in one.what for one in found(take(tmp_path / "lost", lost)))
    later = [replace(shot, time=shot.time + timedelta(days=3 * (i > 20))) for i, shot in enumerate(shots)]
    [one] = found(take(tmp_path / "days", later))
    assert one.weight == "warn" and "2 flights on 2 days" in one.what
    [one] = found(take(tmp_path / "no gps", shots, gps=False))
    assert one.weight == "note" and "No positions" in one.what


def test_one_position_is_not_none(tmp_path: Path) -> None:
    assert not any("osition" in one.what for one in found(take(tmp_path / "alone", lines(1, 1))))
    folder = take(tmp_path / "some", lines(5), gps=False)
    take(folder, lines(5)[:1])
    [one] = found(folder)
    assert one.what == "39 photographs have no position." and "no metres" in one.to_do and len(one.names) == 39


def test_a_camera_that_only_turns_and_one_that_hovers(tmp_path: Path) -> None:
    turning = [replace(shot, east_m=0.0, north_m=0.0, yaw_deg=12.0 * i) for i, shot in enumerate(lines(5))]
    assert any(one.weight == "stop" and "only turns" in one.what for one in found(take(tmp_path / "turns", turning)))
    slow = lines(5, along=0.99)
    assert any("hovers" in one.what and "auto" in one.to_do for one in found(take(tmp_path / "slow", slow)))


def test_few_photographs(tmp_path: Path) -> None:
    assert "small scene" in found(take(tmp_path / "few", lines(2)))[0].what
    assert not any("small scene" in one.what for one in found(take(tmp_path / "enough", lines(5, 8))))
    [short] = found(take(tmp_path / "short", lines(3, 13)))
    assert short.what.startswith("39 photographs: a small scene") and short.to_do == "Take 40 or more."
    for count in (2, 3):
        assert found(take(tmp_path / str(count), lines(1, count)))[0].weight == "stop"
    assert found(take(tmp_path / "one", lines(1, 1)))[0].weight == "stop"
    with pytest.raises(InputError, match="is empty"):
        (tmp_path / "none").mkdir()
        found(tmp_path / "none")


def test_a_list_of_control_points_is_checked_before_anything_is_processed(tmp_path: Path) -> None:
    folder = take(tmp_path, lines(5))
    east, north = 462_000.0, 5_205_500.0  # of 8.5 E, 47 N
    names = ("A", "B", "C", "CHK", "once")
    marks = [
        f"{east + 5 * place} {north + 3 * place**2} 400 100 90 shot_{photo:03d}.jpg {name}"
        for place, name in enumerate(names)
        for photo in ((0, 1) if name != "once" else (0,))
    ]
    file = folder / "gcp_list.txt"
    file.write_text("\n".join(["WGS84 UTM 32N", *marks]))
    (good,) = found(folder)
    assert good.weight == "note" and good.what.startswith("3 control points and 1 check point are marked")
    file.write_text("\n".join(["WGS84 UTM 32N", *marks[2:]]))
    (few,) = found(folder)
    assert few.weight == "warn" and "GPS tells the world" in few.to_do
    file.write_text("\n".join(["WGS84 UTM 33N", *marks]))
    (wrong,) = found(folder)
    assert wrong.weight == "stop" and "line 2" in wrong.what and "WGS84 UTM 32N" in wrong.to_do


def test_masks_are_counted_and_those_of_no_photograph_are_told(tmp_path: Path) -> None:
    take(tmp_path, lines(5))
    for name in ("shot_001_mask.png", "shot_002_mask.png", "shto_003_mask.png"):
        Image.new("L", (320, 240), 255).save(tmp_path / name)
    stray, masked = found(tmp_path)
    assert (stray.weight, stray.names) == ("warn", ("shto_003_mask.png",))
    assert (masked.weight, masked.what.split()[0]) == ("note", "2")


def test_one_of_a_thing_is_told_in_the_singular(tmp_path: Path) -> None:
    dark = some(4, by=lambda p: p.filter(ImageFilter.GaussianBlur(3)).point(lambda v: 0.4 * v))
    folder = take(tmp_path / "flight", lines(5), changed=dark)
    shutil.copy(folder / "shot_001.jpg", folder / "shot_zz.jpg")
    for name in ("shot_001_mask.png", "shto_003_mask.png"):
        Image.new("L", (320, 240), 255).save(folder / name)
    told = {f"{one.what} {one.to_do}" for one in (*found(folder), *found(take(tmp_path / "one", lines(1, 1))))}
    assert told >= {
        "1 photograph is much less sharp than its neighbours. Look at it; delete what is blurred, unless it leaves a gap.",
        "1 photograph is much brighter or darker than its neighbours. Look at it; such a picture is evened out, as far as it"
        " can be.",
        "1 photograph has the same bytes as another one and is left out. Nothing.",
        "1 mask lies beside no photograph and masks nothing. Name the mask of IMG_1.JPG IMG_1_mask.png, and put it beside it.",
        "1 photograph has a mask, which this look does not heed. Nothing.",
        "1 usable photograph; at least 4 are needed. Take more.",
    }
