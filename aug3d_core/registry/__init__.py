"""The registry: `<home>/scenes/<scene>.yaml` says where a scene's photographs are, how and when to make it.

cron       cron lines: which field is wrong, when they fire next
schedule   when a scene is made again: a cron line or an interval, in a time zone
entry      what a file says, as a checked value
document   YAML with the line of everything in it; twice the same key is a mistake
check      document -> entry; every mistake with file, line and field
text       entry -> the commented file that people edit; another schedule in such a file
files      read, write and remove the files; two of one name are refused
"""

from aug3d_core.registry.entry import Publishing, SceneEntry
from aug3d_core.registry.files import (
    read_each,
    read_scene,
    remove_scene,
    scene_file,
    write_scene,
    write_schedule,
)
from aug3d_core.registry.schedule import Schedule

__all__ = [
    "Publishing",
    "SceneEntry",
    "Schedule",
    "read_each",
    "read_scene",
    "remove_scene",
    "scene_file",
    "write_scene",
    "write_schedule",
]
