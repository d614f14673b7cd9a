"""The folder of a study: data for programs, a chart and a page for people."""

from __future__ import annotations

import json
from pathlib import Path
from textwrap import fill

from aug3d_core.charts.front import draw
from aug3d_core.charts.story import Part, tell
from aug3d_core.store import layout
from aug3d_core.store.store import Store, write_synced
from aug3d_core.store.timed import timed_folder
from aug3d_core.tradeoff.chart import charts
from aug3d_core.tradeoff.findings import as_json, cache, table
from aug3d_core.tradeoff.page import chapters, write_page
from aug3d_core.tradeoff.study import Studied

_WIDE = 160  # letters that the chart has room for


def write_study(store: Store, found: Studied, machine: str) -> Path:
    """Write everything into a new folder, named by the time in UTC; return it."""
    folder = timed_folder(store.root / layout.STUDIES / found.scene.name, "tradeoff-")
    write_synced(folder / layout.STUDY_FINDINGS, json.dumps(as_json(found, machine), indent=1).encode())
    table(found).to_parquet(folder / layout.STUDY_SCORES, index=False)
    draw(charts(found), _title(found, machine), folder / layout.STUDY_CHART)
    write_page(found, machine, folder / layout.STUDY_PAGE)
    size = "quick size" if found.quick else _seeds(found)
    tell(store, folder, Part(about=f"{found.scene.name}: time against accuracy, {size}", chapters=chapters(found)))
    return folder


def _title(found: Studied, machine: str) -> str:
    state = cache(found.results)
    settings = fill(" ".join(found.scene.own.overrides), _WIDE)
    return (
        f"{found.scene.name}, preset {found.scene.own.preset}; {_seeds(found)}; "
        f"{state['found_made']} of {state['outputs']} outputs found made\n{settings}\n{machine}\n"
        "orange: as the scene has it, triangle: auto, star: the cheapest that is enough, hollow: another test"
    )


def _seeds(found: Studied) -> str:
    return "one seed" if found.seeds == 1 else f"medians of up to {found.seeds} seeds"
