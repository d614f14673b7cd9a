"""The folder of a study: data for programs, a chart and a page for people."""

from __future__ import annotations

import json
from pathlib import Path

from aug3d_core.charts.story import Part, tell
from aug3d_core.store import layout
from aug3d_core.store.store import Store, write_synced
from aug3d_core.store.timed import timed_folder
from aug3d_core.study.chart import draw
from aug3d_core.study.findings import Findings, as_json
from aug3d_core.study.page import chapters, write_page


def write_study(store: Store, found: Findings) -> Path:
    """Write everything into a new folder, named by the study and the time in UTC; return it."""
    folder = timed_folder(store.root / layout.STUDIES / found.scene, f"{found.study.name}-")
    write_synced(folder / layout.STUDY_FINDINGS, json.dumps(as_json(found), indent=1).encode())
    found.scores.to_parquet(folder / layout.STUDY_SCORES, index=False)
    draw(found, folder / layout.STUDY_CHART)
    write_page(found, folder / layout.STUDY_CHART, folder / layout.STUDY_PAGE)
    about, told = (
        f"{found.scene}: {found.study.name}, {found.seeds} seeds",
        chapters(found, folder / layout.STUDY_CHART),
    )
    tell(store, folder, Part(about=about, chapters=told))
    return folder
