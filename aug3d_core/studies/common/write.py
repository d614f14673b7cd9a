"""Write a study into a folder of its own."""

from __future__ import annotations

from pathlib import Path

from aug3d_core.report.story import Part, tell
from aug3d_core.run.atomic_file import write_synced
from aug3d_core.store import layout
from aug3d_core.store.seal import sealed
from aug3d_core.store.store import Store
from aug3d_core.store.timed import timed_folder
from aug3d_core.studies.common.page import page_of
from aug3d_core.studies.common.publication import Publication


def write_study(store: Store, study: Publication) -> Path:
    """Write data, chart and page into a new folder, named by the time in UTC, and update the story; return the folder."""
    folder = timed_folder(store.root / layout.STUDIES / study.place, f"{study.label}-")
    chart = folder / layout.STUDY_CHART
    write_synced(folder / layout.STUDY_FINDINGS, sealed(study.data))
    study.table.to_parquet(folder / layout.STUDY_SCORES, index=False)
    study.draw(chart)
    chapters = study.chapters(chart)
    (folder / layout.STUDY_PAGE).write_text(page_of(study, chapters), encoding="utf-8")
    if store.shared is not None:  # what it names stays there, whoever cleans up
        store.share_again((stage, key) for stage, key in study.data["objects"])
        store.shared.share_study(folder)
    tell(store, folder, Part(about=study.about, chapters=chapters))
    return folder
