"""Which files of a run's objects its report and its figures read: the others need not be on this machine."""

from __future__ import annotations

from aug3d_core.dataset.files import LEAK_AUDIT
from aug3d_core.depth.files import BASELINE_FUSED
from aug3d_core.domes.files import CAMERAS, DOME_TABLE
from aug3d_core.groups.files import GROUPS
from aug3d_core.judging.files import COMPARED, CONVENTIONS, TEST_VIEWS
from aug3d_core.overlap.files import OVERLAP_MEMBERS, OVERLAP_TABLE
from aug3d_core.photos.files import PHOTO_TABLE, REJECTED_TABLE
from aug3d_core.rendering.files import RENDER_TABLE
from aug3d_core.sfm.files import CONTROL_POINTS, MATCHING_TABLE, POINTS, TRACKS, UNPLACED, VIEWS, WORLD
from aug3d_core.split.files import SPLIT_TABLE
from aug3d_core.store.record import Record

# Beside the pictures of each stage, and those that show the test
_READ = {
    "photos": (PHOTO_TABLE, REJECTED_TABLE),
    "matching": (MATCHING_TABLE,),
    "sfm": (VIEWS, POINTS, TRACKS, WORLD, UNPLACED, CONTROL_POINTS),
    "grouping": (SPLIT_TABLE, GROUPS),
    "overlap": (OVERLAP_TABLE, OVERLAP_MEMBERS),
    "depth": (BASELINE_FUSED,),
    "sampling": (DOME_TABLE, CAMERAS),
    "rendering": (RENDER_TABLE,),
    "dataset": (LEAK_AUDIT,),
    "evaluation": (TEST_VIEWS, CONVENTIONS),
}


def is_read(record: Record, name: str) -> bool:
    """Say whether the report may read a file of an object."""
    shown = record.stage == "evaluation" and name.startswith(f"{COMPARED}/")
    return shown or name in _READ.get(record.stage, ()) or name in record.pictures.values()


def read_of(record: Record) -> list[str]:
    """Return the files of an object that the report reads."""
    return [name for name in record.files if is_read(record, name)]
