"""Settings within settings, by a path of names: `training.head.hidden`."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any


def flat(values: Mapping[str, Any], above: str = "") -> dict[str, Any]:
    """Return every value by its path."""
    found: dict[str, Any] = {}
    for name, value in values.items():
        path = f"{above}.{name}" if above else name
        found |= flat(value, path) if isinstance(value, Mapping) else {path: value}
    return found


def nested(values: Mapping[str, Any]) -> dict[str, Any]:
    """Return values by path as settings within settings: the inverse of `flat`."""
    found: dict[str, Any] = {}
    for path, value in values.items():
        found = merged(found, within(path, value))
    return found


def within(path: str, value: Any) -> dict[str, Any]:
    """Return a value inside the settings that its path names."""
    for name in reversed(path.split(".")):
        value = {name: value}
    return value


def merged(values: Mapping[str, Any], changes: Mapping[str, Any]) -> dict[str, Any]:
    """Return settings with changes to some of them, those within others too."""
    return {
        **values,
        **{
            name: merged(values[name], change)
            if isinstance(change, Mapping) and isinstance(values.get(name), Mapping)
            else change
            for name, change in changes.items()
        },
    }


def value_at(values: Mapping[str, Any], path: str) -> Any:
    """Return the value at a path; raises KeyError with the part of the path that is not there."""
    at: Any = values
    names = path.split(".")
    for depth, name in enumerate(names):
        if not isinstance(at, Mapping) or name not in at:
            raise KeyError(".".join(names[: depth + 1]))
        at = at[name]
    return at
