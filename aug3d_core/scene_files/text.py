"""Write a scene file, and change the schedule in one."""

from __future__ import annotations

import math
from typing import Any

import yaml

from aug3d_core.factory.config import SIZES
from aug3d_core.run.errors import UsageError
from aug3d_core.scene_files.document import composed
from aug3d_core.scene_files.entry import SceneEntry
from aug3d_core.scene_files.schedule import Schedule

_COMMENTS = {
    "photos": "Folder of photographs. A relative path starts at the folder of this file; null is the built-in town.",
    "poses": "Camera poses to use instead of computing them (COLMAP, nerfstudio, Mega-NeRF), or null.",
    "preset": SIZES,
    "settings": "Settings that differ from the preset's, for example training: {steps: 500}.",
    "licence": "Terms under which the photographs may be used, a sentence, and words to find the scene by.",
    "schedule": "When to run it again: cron (minute hour day month weekday, in quotes) or every (30m, 6h, 1d), timezone\n"
    "# (such as Europe/Warsaw), and paused: true to pause it. null: no schedule.",
    "publish": "A new version replaces the published one unless it loses more PSNR than this [dB].",
}


def written(scene: str, entry: SceneEntry) -> str:
    """Return the file of an entry, with a comment over every field."""
    values = entry.model_dump(mode="json")
    parts = [f"# Scene {scene} of aug3d. Edit it by hand as you like; `aug3d scenes show {scene}` checks it.\n"]
    for name, value in values.items():
        if name in _COMMENTS:
            parts.append(f"\n# {_COMMENTS[name]}\n")
        parts.append(_schedule(entry.schedule) if name == "schedule" else _dumped({name: value}))
    return "".join(parts)


def with_schedule(text: str, schedule: Schedule | None) -> str:
    """Return a file's text with another schedule, every other character as it was; raises UsageError.

    The schedule's own lines are replaced, and with them the comments in them; a file without any gets them at its end.
    """
    root = composed(text)
    if root.flow_style:
        raise UsageError("the fields stand in braces, which is not edited here", "change the schedule by hand")
    indent = " " * root.start_mark.column
    lines = _schedule(schedule).replace("\n", f"\n{indent}").rstrip(" ")
    for key, value in root.value:
        if key.value == "schedule":
            end = text.find("\n", _end(text, value))
            return text[: key.start_mark.index] + lines + (text[end + 1 :] if end >= 0 else "")
    return f"{text}{'' if text.endswith(chr(10)) else chr(10)}{indent}{lines}"


def _end(text: str, node: yaml.Node) -> int:
    """Return where a value's last character is: a block ends only after the comments and empty lines below it."""
    while isinstance(node, yaml.CollectionNode) and not node.flow_style and node.value:
        node = node.value[-1][1] if isinstance(node, yaml.MappingNode) else node.value[-1]
    return len(text[: node.end_mark.index].rstrip())


def _schedule(schedule: Schedule | None) -> str:
    if schedule is None:
        return "schedule: null\n"
    when = f'cron: "{schedule.cron}"' if schedule.cron else f"every: {schedule.every}"
    paused = "  paused: true\n" if schedule.paused else ""
    return f"schedule:\n  {when}\n  timezone: {schedule.timezone}\n{paused}"


def _dumped(value: dict[str, Any]) -> str:
    return yaml.safe_dump(value, sort_keys=False, allow_unicode=True, width=math.inf)
