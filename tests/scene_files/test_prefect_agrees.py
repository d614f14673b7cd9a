"""Prefect starts a scene at the moment that aug3d announces."""

from __future__ import annotations

import asyncio
from datetime import UTC, datetime, timedelta

import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from pydantic import ValidationError

from aug3d_core.scene_files.schedule import Schedule

pytestmark = pytest.mark.slow  # Prefect takes seconds to import
MOMENTS = st.datetimes(datetime(2026, 1, 1), datetime(2028, 1, 1), timezones=st.just(UTC))


def field(low: int, high: int) -> st.SearchStrategy[str]:
    value = st.integers(low, high)
    term = st.one_of(
        st.just("*"),
        value.map(str),
        st.integers(2, 9).map("*/{}".format),
        st.tuples(value, value).map(lambda two: f"{min(two)}-{max(two)}"),
    )
    return st.one_of(st.just("*"), st.lists(term, min_size=1, max_size=2).map(",".join))


@given(st.tuples(field(0, 59), field(0, 23), field(1, 31), field(1, 12), field(0, 7)), MOMENTS)
def test_by_cron_lines(fields: tuple[str, ...], now: datetime) -> None:
    from prefect.server.schemas.schedules import CronSchedule

    try:
        schedule = Schedule(cron=" ".join(fields))
    except ValidationError:
        assume(False)
        raise
    announced = schedule.next_time(now)
    assert asyncio.run(CronSchedule(cron=schedule.cron, timezone="UTC").get_dates(1, start=later(now))) == [announced]


@given(st.integers(1, 400), st.sampled_from("mhd"), st.sampled_from(["UTC", "Europe/Warsaw", "Asia/Kolkata"]), MOMENTS)
def test_by_intervals(count: int, unit: str, zone: str, now: datetime) -> None:
    from prefect.server.schemas.schedules import IntervalSchedule

    schedule = Schedule(every=f"{count}{unit}", timezone=zone)
    theirs = IntervalSchedule(interval=schedule.interval(), anchor_date=schedule.anchor(), timezone="UTC")
    assert asyncio.run(theirs.get_dates(1, start=later(now))) == [schedule.next_time(now)]


def later(now: datetime) -> datetime:
    """Return the next whole second: Prefect's first start may be the moment itself, ours comes after it."""
    return now.replace(microsecond=0) + timedelta(seconds=1)
