"""Cron lines, intervals and time zones: what is wrong is named, and what is right comes when it should."""

from __future__ import annotations

from datetime import UTC, datetime, timedelta
from zoneinfo import ZoneInfo

import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from pydantic import ValidationError

from aug3d_core.scene_files.schedule import Schedule

NOW = datetime(2026, 11, 21, 22, 5, tzinfo=UTC)  # a Saturday


@pytest.mark.parametrize(
    ("line", "said"),
    [
        ("61 3 * * 1", "field 1, minute, cannot be '61': 0 to 59"),
        ("0 25 * * 1", "field 2, hour, cannot be '25': 0 to 23"),
        ("0 3 0 * 1", "field 3, day of month, cannot be '0'"),
        ("0 3 * janu *", "field 4, month, cannot be 'janu'"),
        ("0 3 * * mon-fry", "field 5, weekday, cannot be 'mon-fry'"),
        ("0 3 * * fri-mon", "field 5, weekday, cannot be 'fri-mon'"),
        ("*/0 * * * *", "field 1, minute, cannot be '*/0'"),
        ("0 3 L * *", "field 3, day of month, cannot be 'L'"),
        ("0 3 * *", "has 4 fields, not 5: minute, hour, day of month, month, weekday"),
        ("0 0 3 * * 1", "has 6 fields"),
        ("@daily", "has 1 fields"),
        ("", "has 0 fields"),
        ("0 3 31 2,4 *", "never comes: month 2,4 has no day 31"),
        ("0 3 */2 * 1", "give day */2 or weekday 1, not both"),
    ],
)
def test_a_cron_line_that_is_wrong_is_told_by_field(line: str, said: str) -> None:
    with pytest.raises(ValidationError, match=r"^1 validation error for Schedule\ncron\n") as told:
        Schedule(cron=line)
    assert said in str(told.value)


@pytest.mark.parametrize("every", ["0h", "90", "1.5h", "-1d", "6 h", "1w", "", "99999d", "٣h"])
def test_an_interval_that_is_none(every: str) -> None:
    with pytest.raises(ValidationError, match="such as 30m, 6h or 1d"):
        Schedule(every=every)


@pytest.mark.parametrize(
    ("zone", "said"),
    [
        ("Warsaw", "did you mean Europe/Warsaw?"),
        ("europe/warsaw", "did you mean Europe/Warsaw?"),
        ("Europe/Warszawa", "did you mean Europe/Warsaw?"),
        ("New York", "did you mean America/New_York?"),
        ("nowhere at all", "looks like Europe/Warsaw"),
        ("../../etc/passwd", "looks like Europe/Warsaw"),
        ("", "looks like Europe/Warsaw"),
    ],
)
def test_a_time_zone_that_is_none_is_told_with_the_nearest(zone: str, said: str) -> None:
    with pytest.raises(ValidationError) as told:
        Schedule(every="6h", timezone=zone)
    assert said in str(told.value)


def test_a_schedule_is_a_cron_line_or_an_interval() -> None:
    with pytest.raises(ValidationError, match="needs cron or every"):
        Schedule()
    with pytest.raises(ValidationError, match="takes cron or every, not both"):
        Schedule(cron="0 3 * * 1", every="6h")


def test_the_next_start_and_the_words() -> None:
    weekly = Schedule(cron="0  3 * * mon", timezone="Europe/Warsaw")
    assert weekly.cron == "0 3 * * mon"
    assert weekly.next_time(NOW) == datetime(2026, 11, 23, 3, tzinfo=ZoneInfo("Europe/Warsaw"))
    assert weekly.words() == "At 03:00 on Monday (Europe/Warsaw)"
    assert Schedule(every="6h").next_time(NOW) == datetime(2026, 11, 22, tzinfo=UTC)
    assert Schedule(every="7d").next_time(NOW) == datetime(2026, 11, 23, tzinfo=UTC), "weeks begin on Mondays"
    paused = Schedule(every="6h", paused=True)
    assert paused.next_time(NOW) is None and paused.words() == "Every 6h (UTC), paused"


@given(
    st.integers(1, 9999),
    st.sampled_from("mhd"),
    st.datetimes(datetime(2020, 1, 1), datetime(2040, 1, 1), timezones=st.just(UTC)),
)
@example(1, "d", datetime(2026, 1, 5, tzinfo=UTC))
def test_intervals_are_as_long_as_they_say(count: int, unit: str, now: datetime) -> None:
    schedule = Schedule(every=f"{count}{unit}", timezone="Europe/Warsaw")
    interval = timedelta(minutes=count * {"m": 1, "h": 60, "d": 1440}[unit])
    first = schedule.next_time(now)
    assert schedule.interval() == interval and first
    assert now < first <= now + interval
    following = schedule.next_time(first)
    assert following and following.astimezone(UTC) - first.astimezone(UTC) == interval
