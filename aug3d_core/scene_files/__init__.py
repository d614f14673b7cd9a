"""The scene files `<home>/scenes/<scene>.yaml`: where a scene's photographs are, and how and when to run it.

cron       cron lines: which field is wrong, when they fire next
schedule   when a scene is run again: a cron line or an interval, in a time zone
entry      the content of a file, validated
document   YAML with the line number of each value; duplicate keys are refused
check      document -> entry; reports every mistake with file, line and field
text       entry -> the commented file that people edit; another schedule in such a file
registry   a folder of such files: read, write and remove them; two of one name are refused
files      the registry of scenes
mirror     the registries in a shared store, for workers of other machines
"""

from aug3d_core.scene_files.entry import Publishing, SceneEntry
from aug3d_core.scene_files.files import read_each, read_scene, remove_scene, scene_file, write_scene, write_schedule
from aug3d_core.scene_files.schedule import Schedule

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
