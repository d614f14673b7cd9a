"""`aug3d predict --photos DIR`: photographs that aug3d has never seen -> poses, views, a flight. And models by their names."""

from __future__ import annotations

import json
import shutil
import time
from collections.abc import Mapping
from functools import partial
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.markup import escape

from aug3d_core.collections.versions import model_of
from aug3d_core.factory.build import Built, Work, build, work_of
from aug3d_core.factory.config import AUTO, scene_config
from aug3d_core.factory.material import Material, Source, source_of
from aug3d_core.factory.stages import PREVIEW, TO_POSES
from aug3d_core.factory.walk import Visit, walk
from aug3d_core.heads.config import shipped
from aug3d_core.novel.config import PreviewConfig
from aug3d_core.novel.files import PREVIEW_FLIGHT, PREVIEW_SHEET, PREVIEW_VIEWS
from aug3d_core.run.errors import UsageError
from aug3d_core.store import layout
from aug3d_core.store.record import Record
from aug3d_core.store.scenes import object_of, versions
from aug3d_core.store.scenes import scenes as made_scenes
from aug3d_core.store.store import Store
from flows.reading import version_with
from flows.refusal import check_photos

TOWNS = "towns"  # the model that is shipped


def model_named(store: Store, name: str) -> Source:
    """Return the model of a collection, of a scene or SCENE@VERSION as an input of a stage, or the shipped one.

    Raises UsageError.
    """
    if name == TOWNS:
        folder, digest, modules = shipped()
        return Source(path=folder, digest=digest, modules=modules)
    version_named = "@" in name
    if not version_named and versions(store, name, layout.COLLECTIONS):
        return source_of(store, model_of(store, name))
    if version_named or name in made_scenes(store):
        return source_of(store, object_of(store, version_with(store, name, "training"), "training"))
    known = sorted({*made_scenes(store), *made_scenes(store, layout.COLLECTIONS)})
    raise UsageError(f"there is no model {name!r} in {store.root}", f"models here: {', '.join([TOWNS, *known])}")


def preview(store: Store, photos: Path, model: str, out: Path | None, as_json: bool) -> int:
    """Find the poses of photographs, and predict views of them; returns the exit code."""
    check_photos(photos)
    if out is not None and out.exists() and (not out.is_dir() or any(out.iterdir())):
        raise UsageError(f"--out {out} is no new or empty folder", "name one that does not exist")
    console, started = Console(stderr=as_json), time.monotonic()
    with store.using(), console.status("finding poses ...") as status:
        trained = model_named(store, model)

        def made(name: str, work: Work) -> Built:
            status.update(f"{name} ...")
            built = build(store, work, partial(_say, status, name))
            console.print(
                f"{name}: {built.record.seconds:.0f} s{' (in the store)' if built.cached else ''}", highlight=False
            )
            return built

        def make(visit: Visit) -> Built:
            assert visit.work
            return made(visit.step.name, visit.work)

        material = Material(photos=photos.resolve())
        records: dict[str, Record] = {}
        for visit in walk(store, TO_POSES, scene_config(AUTO), material, make):
            assert visit.record
            records[visit.step.name] = visit.record
        sources = {"sfm": source_of(store, records["sfm"]), "training": trained}
        record = made("views and flight", work_of(PREVIEW, PreviewConfig(), sources)).record
        folder = _handed_over(store.files_dir(record), out)
    told = {
        "state": record.state,
        "model": model,
        "sheet": str(folder / PREVIEW_SHEET),
        "flight": str(folder / PREVIEW_FLIGHT),
        "views": str(folder / PREVIEW_VIEWS),
        "registered": records["sfm"].metrics.get("registered"),
        "metrics": record.metrics,
        "notes": [*(note for one in records.values() for note in one.notes), *record.notes],
        "seconds": round(time.monotonic() - started, 1),
    }
    if as_json:
        print(json.dumps(told, indent=1))
    else:
        _print(console, told)
    return 3 if record.state == "degraded" else 0


def _print(console: Console, told: Mapping[str, Any]) -> None:
    figures = told["metrics"]
    console.print(f"\n{figures['photographs']} photographs have a pose", highlight=False)
    console.print(
        f"photographs predicted from others: {figures['preview_psnr']:.2f} dB,"
        f" {figures['over_best_cheap_db']:+.2f} dB [at least {figures['over_best_cheap_low_db']:+.2f}] over the better answer"
        " without learning",
        highlight=False,
        markup=False,
    )
    for what in ("sheet", "flight", "views"):
        console.print(f"{what:>7}  {told[what]}", highlight=False, soft_wrap=True, markup=False)
    for note in told["notes"]:
        console.print(f"[yellow]note[/] {escape(note)}", highlight=False)
    console.print(f"{told['seconds']:.0f} s in all", highlight=False)


def _say(status, name: str, done: int, total: int, what: str) -> None:
    status.update(f"{name}: {done} of {total} {what}")


def _handed_over(files: Path, out: Path | None) -> Path:
    """Return where the pictures are: in the store, or in the folder that the user wanted."""
    if out is None:
        return files
    out.mkdir(parents=True, exist_ok=True)
    for name in (PREVIEW_SHEET, PREVIEW_FLIGHT):
        shutil.copyfile(files / name, out / name)
    shutil.copytree(files / PREVIEW_VIEWS, out / PREVIEW_VIEWS)
    return out
