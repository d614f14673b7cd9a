"""Cron lines of five fields: minute, hour, day of month, month, weekday. Only what all cron programs take alike."""

from __future__ import annotations

import re
from datetime import UTC, datetime

from cronsim import CronSim, CronSimError

_FIELDS = (
    ("minute", "0 to 59"),
    ("hour", "0 to 23"),
    ("day of month", "1 to 31"),
    ("month", "1 to 12 or jan to dec"),
    ("weekday", "0 to 7 or sun to sat, where 0 and 7 are Sunday"),
)
_VALUE = r"(\d{1,2}|[a-z]{3})"
_TERM = rf"(\*|{_VALUE}(-{_VALUE})?)(/\d{{1,2}})?"
_PART = re.compile(rf"{_TERM}(,{_TERM})*", re.IGNORECASE | re.ASCII)
_ANY_TIME = datetime(2026, 1, 1, tzinfo=UTC)


def checked_cron(line: str) -> str:
    """Return a cron line with single spaces; raises ValueError that names the field which is wrong."""
    parts = line.split()
    if len(parts) != len(_FIELDS):
        names = ", ".join(name for name, _ in _FIELDS)
        raise ValueError(f"has {len(parts)} fields, not {len(_FIELDS)}: {names}")
    for i, (part, (name, bounds)) in enumerate(zip(parts, _FIELDS, strict=True)):
        alone = ["*"] * i + [part] + ["*"] * (len(_FIELDS) - 1 - i)
        if not _PART.fullmatch(part) or not _fires(alone):
            raise ValueError(f"field {i + 1}, {name}, cannot be {part!r}: {bounds}; also *, 1-5, 1,3 and */2")
    _, _, day, month, weekday = parts
    if not _fires(["0", "0", day, month, "*"]):
        raise ValueError(f"never comes: month {month} has no day {day}")
    if day != "*" and weekday != "*" and "*" in day + weekday:
        # Debian's cron takes days that are both, others, and Prefect, days that are either.
        raise ValueError(f"means different days to different programs: give day {day} or weekday {weekday}, not both")
    return " ".join(parts)


def next_by_cron(line: str, after: datetime) -> datetime:
    """Return when a line fires next, in the time zone of `after`."""
    return next(CronSim(line, after))


def cron_in_words(line: str) -> str:
    """Return a line as people say it: `At 03:00 on Monday`."""
    return CronSim(line, _ANY_TIME).explain()


def _fires(parts: list[str]) -> bool:
    try:
        CronSim(" ".join(parts), _ANY_TIME)
    except CronSimError:
        return False
    return True
