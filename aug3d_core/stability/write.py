"""The folder of the study: data for programs, a map and a page for people."""

from __future__ import annotations

import json
from pathlib import Path

from aug3d_core.charts.story import Part, tell
from aug3d_core.stability.findings import Findings, as_json, cell_table
from aug3d_core.stability.map import draw
from aug3d_core.stability.page import chapters, write_page
from aug3d_core.store import layout
from aug3d_core.store.store import Store, write_synced
from aug3d_core.store.timed import timed_folder

NAME = "stability"


def write_study(store: Store, found: Findings) -> Path:
    """Write everything into a new folder, named by the time in UTC; return it."""
    folder = timed_folder(store.root / layout.STUDIES / NAME, f"{found.size}-")
    write_synced(folder / layout.STUDY_FINDINGS, json.dumps(as_json(found), indent=1).encode())
    cell_table(found).to_parquet(folder / layout.STUDY_SCORES, index=False)
    draw(found, folder / layout.STUDY_CHART)
    write_page(store, found, folder / layout.STUDY_CHART, folder / layout.STUDY_PAGE)
    told = chapters(found, folder / layout.STUDY_CHART)
    tell(store, folder, Part(about=f"stability, {found.size} size", chapters=told))
    return folder
