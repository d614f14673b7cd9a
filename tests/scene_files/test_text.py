"""The file that aug3d writes says what it should, and keeps what people wrote."""

from __future__ import annotations

from pathlib import Path

import pytest
import yaml
from hypothesis import given
from hypothesis import strategies as st

from aug3d_core.run.errors import UsageError
from aug3d_core.scene_files.check import checked_entry
from aug3d_core.scene_files.entry import Publishing, SceneEntry
from aug3d_core.scene_files.schedule import Schedule
from aug3d_core.scene_files.text import with_schedule, written

FILE = Path("/home/ann/scenes/hill.yaml")
TEXTS = st.text(st.characters(exclude_categories=["Cs", "Cc"]), max_size=30)
SCHEDULES = st.builds(
    Schedule,
    cron=st.sampled_from(["0 3 * * 1", "*/30 * * * *", "0 0 1 jan *"]),
    timezone=st.sampled_from(["UTC", "Europe/Warsaw"]),
    paused=st.booleans(),
) | st.builds(Schedule, every=st.sampled_from(["30m", "6h", "1d"]), timezone=st.sampled_from(["UTC", "Asia/Tokyo"]))
SETTINGS = st.fixed_dictionaries(
    {},
    optional={
        "training": st.fixed_dictionaries({}, optional={"steps": st.integers(1, 9), "learning_rate": st.just(1e-5)}),
        "grouping": st.fixed_dictionaries({"k": st.sampled_from(["auto", 8])}),
    },
)
ENTRIES = st.builds(
    SceneEntry,
    photos=TEXTS.map(lambda name: Path("/photos") / name.replace("/", "-")),
    poses=st.none() | st.just(Path("/poses/a b: c")),
    preset=st.sampled_from(["tiny", "paper"]),
    settings=SETTINGS,
    licence=st.none() | TEXTS | st.sampled_from(["no", "4.0", "2026-01-01", "1:30", "~", "- a", "# b", "a: b"]),
    description=TEXTS,
    tags=st.lists(TEXTS, max_size=3).map(tuple),
    schedule=st.none() | SCHEDULES,
    publish=st.builds(Publishing, most_psnr_drop_db=st.floats(0, 99)),
)


@given(ENTRIES)
def test_what_is_written_is_read(entry: SceneEntry) -> None:
    assert checked_entry(FILE, written("hill", entry).encode()) == entry


@given(ENTRIES, st.none() | SCHEDULES)
def test_a_schedule_is_changed_and_nothing_else(entry: SceneEntry, schedule: Schedule | None) -> None:
    text = written("hill", entry)
    changed = with_schedule(text, schedule)
    assert changed == written("hill", entry.model_copy(update={"schedule": schedule}))
    assert with_schedule(changed, entry.schedule) == text


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("photos: a  # mine\n", "photos: a  # mine\nschedule:\n  every: 6h\n  timezone: UTC\n"),
        ("photos: a", "photos: a\nschedule:\n  every: 6h\n  timezone: UTC\n"),
        ("schedule: # why\n\n# next\nphotos: a\n", "schedule:\n  every: 6h\n  timezone: UTC\n\n# next\nphotos: a\n"),
        (
            "# top\nschedule:\n  cron: 0 3 * * 1  # gone\n  # gone\n  paused: yes # gone\n  # below\n\n# next\nphotos: a\n",
            "# top\nschedule:\n  every: 6h\n  timezone: UTC\n  # below\n\n# next\nphotos: a\n",
        ),
        ("schedule: {every: 1d,\n  paused: true}\nphotos: a", "schedule:\n  every: 6h\n  timezone: UTC\nphotos: a"),
        (
            "schedule:\n  every: >-\n    1d\n# kept\nphotos: a",
            "schedule:\n  every: 6h\n  timezone: UTC\n# kept\nphotos: a",
        ),
        ("photos: a\nschedule: null", "photos: a\nschedule:\n  every: 6h\n  timezone: UTC\n"),
        ("  photos: a\n  tags: []\n", "  photos: a\n  tags: []\n  schedule:\n    every: 6h\n    timezone: UTC\n"),
        ("  schedule: null\n  photos: a\n", "  schedule:\n    every: 6h\n    timezone: UTC\n  photos: a\n"),
        (
            "photos: é\r\nschedule: null\r\n# kept\r\n",
            "photos: é\r\nschedule:\n  every: 6h\n  timezone: UTC\n# kept\r\n",
        ),
    ],
)
def test_what_people_wrote_elsewhere_stays(text: str, expected: str) -> None:
    changed = with_schedule(text, Schedule(every="6h"))
    assert changed == expected
    assert yaml.safe_load(changed)["schedule"] == {"every": "6h", "timezone": "UTC"}


def test_fields_in_braces_are_left_to_people() -> None:
    with pytest.raises(UsageError, match="by hand"):
        with_schedule("{photos: a, schedule: null}", None)
