"""What the figures of a stage mean: declared with the stage, used by tables, comparisons and MLflow."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from fnmatch import fnmatchcase
from typing import Literal

# The unit stands in the name, with another figure after it at most (`pose_error_m_median`); the first that fits.
_UNITS = (
    ("s", re.compile(r"(^|_)seconds")),
    ("ms", re.compile(r"_ms(_|$)")),
    ("1/s", re.compile(r"per_second$")),
    ("1/min", re.compile(r"per_minute$")),
    ("", re.compile(r"share|ssim|flip")),
    ("dB", re.compile(r"psnr|_db(_|$)|^(group|cheap|over)_")),
    ("%", re.compile(r"_pct(_|$)")),
    ("degrees", re.compile(r"_deg(_|$)")),
    ("px", re.compile(r"_px(_|$)")),
    ("m", re.compile(r"_m(_|$)")),
    ("world units", re.compile(r"_units(_|$)|^slab_thickness$")),
    ("photo pixels on the ground", re.compile(r"_gsd$")),
    ("MiB", re.compile(r"_mib$")),
)


Better = Literal["higher", "lower"] | None


@dataclass(frozen=True)
class MetricSpec:
    """unit: "" for a share, a count or a word. better: the better side, None where neither is better."""

    unit: str
    better: Better


def declared(*, higher: str = "", lower: str = "", neither: str = "") -> Mapping[str, MetricSpec]:
    """Return the declaration of figures by name: names separated by spaces; `*` in a name stands for any text."""
    sides: tuple[tuple[Better, str], ...] = (("higher", higher), ("lower", lower), (None, neither))
    return {name: MetricSpec(unit_of(name), better) for better, names in sides for name in names.split()}


def spec_of(name: str, metrics: Mapping[str, MetricSpec]) -> MetricSpec | None:
    """Return the declaration of a figure, None if it has none."""
    if name in metrics:
        return metrics[name]
    found = next((spec for pattern, spec in metrics.items() if "*" in pattern and fnmatchcase(name, pattern)), None)
    return MetricSpec(unit_of(name), found.better) if found else None


def unit_of(name: str) -> str:
    """Return the unit that stands in a figure's name."""
    return next((unit for unit, pattern in _UNITS if pattern.search(name)), "")
