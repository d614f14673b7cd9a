"""When a scene is run again automatically."""

from __future__ import annotations

import difflib
import re
from datetime import UTC, datetime, timedelta
from functools import cache
from typing import Self
from zoneinfo import ZoneInfo, available_timezones

from pydantic import Field, field_validator, model_validator

from aug3d_core.run.stage import Frozen
from aug3d_core.scene_files.cron import checked_cron, cron_in_words, next_by_cron

_EVERY = re.compile(r"([1-9]\d{0,3})([mhd])", re.ASCII)
_UNITS = {"m": "minutes", "h": "hours", "d": "days"}


class Schedule(Frozen):
    """A cron line (follows the local clock) or an interval (counts elapsed time).

    Intervals are counted from a Monday's midnight: 6h is 0, 6, 12 and 18 o'clock, an hour later in summer.
    """

    cron: str | None = Field(default=None, description="Minute, hour, day of month, month, weekday: 0 3 * * 1.")
    every: str | None = Field(
        default=None, description="Interval between two starts in minutes, hours or days: 30m, 6h, 1d."
    )
    timezone: str = Field(default="UTC", description="Time zone of the schedule, such as Europe/Warsaw.")
    paused: bool = Field(default=False, description="Keep the schedule, but start no runs.")

    @field_validator("cron")
    @classmethod
    def _cron_fires(cls, line: str | None) -> str | None:
        return None if line is None else checked_cron(line)

    @field_validator("every")
    @classmethod
    def _interval_is_known(cls, every: str | None) -> str | None:
        if every is not None and not _EVERY.fullmatch(every):
            raise ValueError("is not an interval: write minutes, hours or days such as 30m, 6h or 1d")
        return every

    @field_validator("timezone")
    @classmethod
    def _zone_is_known(cls, name: str) -> str:
        if name not in _zones():
            near = _nearest_zones(name)
            hint = f"did you mean {' or '.join(near)}?" if near else "a name looks like Europe/Warsaw"
            raise ValueError(f"is not a time zone: {hint}")
        return name

    @model_validator(mode="after")
    def _is_one_of_both(self) -> Self:
        if (self.cron is None) == (self.every is None):
            raise ValueError("takes cron or every, not both" if self.cron else "needs cron or every")
        return self

    def interval(self) -> timedelta | None:
        """Return the time between two starts; None where a cron line says when."""
        parts = _EVERY.fullmatch(self.every or "")
        return timedelta(**{_UNITS[parts[2]]: int(parts[1])}) if parts else None

    def anchor(self) -> datetime:
        """Return the start from which intervals are counted, in UTC: Prefect counts days of 23 hours in other zones."""
        return datetime(2026, 1, 5, tzinfo=ZoneInfo(self.timezone)).astimezone(UTC)

    def next_time(self, after: datetime) -> datetime | None:
        """Return the next start after a moment (with a time zone), in the schedule's time zone; None while paused."""
        if self.paused:
            return None
        zone = ZoneInfo(self.timezone)
        interval = self.interval()
        if interval is None:
            return next_by_cron(self.cron or "", after.astimezone(zone))
        utc = after.astimezone(UTC)  # hours that pass: within one zone Python counts what clocks show
        return (utc + interval - (utc - self.anchor()) % interval).astimezone(zone)

    def words(self) -> str:
        """Return the schedule in words."""
        what = cron_in_words(self.cron) if self.cron else f"Every {self.every}"
        return f"{what} ({self.timezone}){', paused' if self.paused else ''}"


@cache
def _zones() -> frozenset[str]:
    return frozenset(available_timezones())


def _nearest_zones(name: str) -> list[str]:
    zones = sorted(zone for zone in _zones() if "/" in zone or zone == "UTC")
    by_city = {zone.rpartition("/")[2].lower(): zone for zone in zones}
    by_name = {zone.lower(): zone for zone in zones}
    wanted = name.lower().replace(" ", "_")
    near = [by_name[n] for n in difflib.get_close_matches(wanted, by_name, n=1, cutoff=0.8)]
    near += [by_city[n] for n in difflib.get_close_matches(wanted.rpartition("/")[2], by_city, n=1, cutoff=0.8)]
    return list(dict.fromkeys(near))
