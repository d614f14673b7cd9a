"""`aug3d advise`: which photographs to take next, as a list, on a map, and as missions for the drone."""

from __future__ import annotations

import json
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.console import Console

from aug3d_core.export.target_folder import check_empty
from aug3d_core.judging.files import COMPARED
from aug3d_core.sfm.files import POINTS, VIEWS, WORLD
from aug3d_core.store.scenes import object_of, records_of
from aug3d_core.surface.files import BASELINE_MESH
from flows.options import DEFAULT_HOME, AsJson, Home
from flows.reading import read_store, version_with
from flows.refusal import typed_errors

if TYPE_CHECKING:
    from aug3d_core.advice.plan import Plan

_NO_GPS = (
    "no GPS: places are in the scene's world, and there are no files for the field. --margin-m, in metres, says nothing there:"
    " a fifth of the flight's height is kept above what is near"
)


def advise(
    scene: Annotated[str, typer.Argument(help="Name of a scene with a mesh, or SCENE@VERSION.")],
    folder: Annotated[Path, typer.Argument(metavar="DIR", help="New or empty folder to write to.")],
    photos: Annotated[int, typer.Option(min=1, max=2000, help="How many photographs can be taken.")] = 20,
    margin_m: Annotated[
        float, typer.Option(min=5.0, max=200.0, help="Least distance above what is known nearby [m]; needs GPS.")
    ] = 15.0,
    home: Home = DEFAULT_HOME,
    as_json: AsJson = False,
) -> None:
    """Say which photographs to take next: where too few see the ground, from which sides, and where the model errs.

    Writes a page with a map, a table, and with GPS files for the field: KML, GeoJSON and a mission for DJI's drones. What no
    photograph shows may be higher than any known roof: look at the site before you fly.
    """
    with typed_errors(as_json, home):
        check_empty(folder)
        # With open3d, which other commands do without
        from aug3d_core.advice.page import advice_page, caution, verdict
        from aug3d_core.advice.plan import plan_of
        from aug3d_core.advice.written import write_advice
        from aug3d_core.geometry.ply import Mesh

        store = read_store(home)
        with store.using(), Console(stderr=True).status("looking at the site ...") as status:
            version = version_with(store, scene, "sfm", "surface")
            sfm = store.files_dir(object_of(store, version, "sfm"), [VIEWS, POINTS, WORLD])
            surface = store.files_dir(object_of(store, version, "surface"), [BASELINE_MESH])
            judged = [record for record in records_of(store, version).values() if record.stage == "evaluation"]
            compared = [[name for name in record.files if name.startswith(f"{COMPARED}/")] for record in judged]
            evaluations = [store.files_dir(record, names) for record, names in zip(judged, compared, strict=True)]
            plan = plan_of(
                sfm, surface, evaluations, photos, margin_m,
                lambda what, done, total: status.update(f"{what}: {done} of {total}"),
            )  # fmt: skip
            mesh = Mesh.load(surface / BASELINE_MESH)
            files = write_advice(plan, scene, folder, lambda names: advice_page(scene, plan, mesh, names))
        notes = [*filter(None, [caution(plan)]), *([_NO_GPS] if plan.origin is None else [])]
        if as_json:
            print(json.dumps(_told(plan, scene, folder, files, verdict(plan), notes), indent=1))
            return
        console = Console()
        console.print(verdict(plan), highlight=False, soft_wrap=True, markup=False)
        for note in notes:
            console.print(f"[yellow]note[/] {note}", highlight=False, soft_wrap=True)
        console.print(f"{', '.join(files)} are in {folder}", highlight=False, soft_wrap=True, markup=False)


def _told(plan: Plan, scene: str, folder: Path, files: list[str], verdict: str, notes: list[str]) -> dict:
    return {
        "scene": scene,
        "verdict": verdict,
        "notes": notes,
        "take_off_m": plan.take_off_m,
        "folder": str(folder),
        "files": files,
        "unit": plan.unit,
        "looked_at": plan.choice.looked_at,
        "missing": list(plan.choice.missing),
        "floor": plan.site.floor,
        "highest_roof": plan.site.roof,
        "photographs": [asdict(one) for one in plan.choice.advised],
    }
