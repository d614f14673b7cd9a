"""The small towns that cells run on: a cell costs seconds, and undisturbed every stage says that it is fine."""

from __future__ import annotations

from collections.abc import Mapping

_SETTINGS: Mapping[str, Mapping[str, object]] = {
    "town": {"length_m": 90, "width_m": 80, "altitude_m": 45, "width_px": 320, "samples": 4},
    "matching": {"max_features": 2048},
}
SMALL_TOWN = tuple(f"{stage}.{name}={value}" for stage, fields in _SETTINGS.items() for name, value in fields.items())

# A strip three footprints and more in length: parts of it share nothing, and there is room for a test with a gap around it
LONG_TOWN = (*SMALL_TOWN, "town.length_m=200", "town.width_m=60")
