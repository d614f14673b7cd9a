"""The command line. Exit codes: 0 done, 1 failed with a typed error, 2 wrong use, 3 done but degraded."""

from __future__ import annotations

import json
import os
import shlex
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.console import Console
from rich.markup import escape

from aug3d_core.doctor import examine
from aug3d_core.factory.config import SIZES, SceneConfig, scene_config
from aug3d_core.factory.material import Material
from aug3d_core.poses.recognise import CLOUD, COLMAP, DTU, GLB, MAP, NERFSTUDIO
from aug3d_core.run.garbage import collect_seldom
from aug3d_core.run.limits import limits_from
from aug3d_core.run.stage import Stage
from aug3d_core.store.scene_name import check_scene_name
from aug3d_core.store.scenes import (
    bring_report,
    newest_whole,
    object_of,
    paths_here,
    records_before,
    version_metrics,
    versions,
)
from aug3d_core.store.store import Store
from aug3d_core.store.version_name import find_version
from flows.advise import advise
from flows.bench import bench
from flows.collections import collections
from flows.compare import compare_runs
from flows.frames import frames
from flows.gc import gc
from flows.hand_on import export_groups, export_map, export_model, export_points
from flows.join import worker
from flows.look import look
from flows.open import open_report
from flows.options import DEFAULT_HOME, AsJson, Home
from flows.plan import checked_plan, expected_times, following, nothing_to_do
from flows.plan_table import print_plan
from flows.predict import predict
from flows.preflight import check_servers, check_weights
from flows.reading import read_store, version_with
from flows.refusal import check_photos, typed_errors
from flows.registered import as_registered, tell_of_file
from flows.scenes import scenes
from flows.server import prefect_server
from flows.serving import secrets_read
from flows.settings import OURS, apply_local_environment, reach_this_machine_directly
from flows.status import status
from flows.study import study
from flows.study_generalisation import study_generalisation
from flows.study_stability import study_stability
from flows.study_tradeoff import study_tradeoff
from flows.summary import command, print_summary, tell_of_damage
from flows.up import up
from flows.verify import verify
from flows.view import view

app = typer.Typer(
    name="aug3d",
    help="From drone photographs to a trained view-synthesis model, and the truth about how good it is.\n\n"
    "Start with **aug3d demo**, then **aug3d run my_scene --photos DIR**.",
    no_args_is_help=True,
    rich_markup_mode="markdown",  # of rich's own, units in brackets would be taken for styles
    add_completion=False,
    pretty_exceptions_enable=False,
)
Preset = Annotated[str, typer.Option(help=SIZES)]
DEFAULT_PRESET = "tiny"
Set = Annotated[
    list[str],
    typer.Option("--set", metavar="STAGE.FIELD=VALUE", help="Change one setting, e.g. training.steps=500. Repeatable."),
]
Version = Annotated[
    str, typer.Argument(metavar="SCENE", help="Name of the scene, or SCENE@VERSION as in aug3d compare.")
]
DryRun = Annotated[bool, typer.Option("--dry-run", help="Say what would be computed, and what it takes, and stop.")]
# The last step that each format is written from; others take poses and photographs
_MADE_OF = {DTU: "dataset", MAP: "surface", GLB: "surface", CLOUD: "depth"}


@app.command()
def demo(
    home: Home = DEFAULT_HOME,
    preset: Preset = DEFAULT_PRESET,
    set_: Set = [],
    as_json: AsJson = False,
    dry_run: DryRun = False,
) -> None:
    """Run the whole factory on the built-in town: minutes on 2 cores. A second time nothing is computed again."""
    with typed_errors(as_json, home, goes_on=True):
        _run("demo", Material(), preset, scene_config(preset, set_), home, as_json, dry_run)


@app.command()
def run(
    scene: Annotated[str, typer.Argument(help="Name of the scene: letters, digits, '-' and '_'.")],
    photos: Annotated[
        Path | None,
        typer.Option(help="Folder of photographs (JPEG, PNG, TIFF; subfolders too). A registered scene needs none."),
    ] = None,
    poses: Annotated[
        Path | None,
        typer.Option(
            help="Take camera poses from here: COLMAP model, nerfstudio transforms.json, or Mega-NeRF folder."
        ),
    ] = None,
    home: Home = DEFAULT_HOME,
    preset: Annotated[
        str | None, typer.Option(help=SIZES, show_default=f"{DEFAULT_PRESET}, or what the registry says")
    ] = None,
    set_: Set = [],
    as_json: AsJson = False,
    dry_run: DryRun = False,
) -> None:
    """Run the whole factory on your photographs.

    A registered scene needs no more than its name: without --photos, what is not said here is as its file says.

    Killed half way? Run the same command again: finished stages are not computed twice.
    """
    with typed_errors(as_json, home, goes_on=True):
        check_scene_name(scene)
        if photos is None:
            material, preset, config = as_registered(home, scene, poses, preset, set_)
        else:
            check_photos(photos)
            material = Material(photos=photos.resolve(), poses=poses.resolve() if poses else None)
            preset = preset or DEFAULT_PRESET
            config = scene_config(preset, set_)
        _run(scene, material, preset, config, home, as_json, dry_run)


@app.command()
def show(scene: Version, home: Home = DEFAULT_HOME, as_json: AsJson = False) -> None:
    """Show what exists of a scene, what it cost, how good it is, and where the report is."""
    with typed_errors(as_json, home):
        store = read_store(home)
        tell_of_damage(store, scene.partition("@")[0])
        version = find_version(store, scene)
        metrics = version_metrics(version)
        bring_report(store, version)
        metrics |= {"paths": paths_here(store, version, metrics)}
        if as_json:
            print(json.dumps(metrics, indent=1))
        else:
            print_summary(Console(), metrics)
            _print_failure(metrics)
            if "failure" in metrics and "@" not in scene:
                _print_earlier(store, scene, home)


@app.command("export")
def export_scene(
    scene: Version,
    folder: Annotated[Path, typer.Argument(metavar="DIR", help="New or empty folder to write to.")],
    form: Annotated[
        str, typer.Option("--format", help=f"For which tools: {COLMAP}, {NERFSTUDIO}, {DTU}, {MAP}, {GLB} or {CLOUD}.")
    ],
    home: Home = DEFAULT_HOME,
    as_json: AsJson = False,
) -> None:
    """Write a scene for other tools: photographs with their poses, groups, a map, a mesh or points.

    colmap, nerfstudio: poses, points and undistorted photographs; dtu: groups for pixelNeRF; map: orthophoto and surface model
    as GeoTIFF, and cameras; glb: the mesh for Blender and browsers; points: the point cloud as LAZ and PLY.
    """
    from aug3d_core.export.folder_formats import (  # with scipy and pandas, which other commands do without
        IMAGES,
        export,
        read_of,
    )

    with typed_errors(as_json, home):
        store = read_store(home)
        with store.using():
            version = version_with(store, scene, _MADE_OF.get(form, "sfm"))
            if form == DTU:
                export_groups(store.files_dir(object_of(store, version, "dataset")), folder, as_json)
                return
            if form in (of_surface := {MAP: export_map, GLB: export_model, CLOUD: export_points}):
                of_surface[form](store, version, folder, as_json)
                return
            records = (object_of(store, version, step) for step in ("sfm", "photos"))
            sfm, photos = (store.files_dir(record, read_of(record)) for record in records)
            views = export(sfm, photos, form, folder)
        if as_json:
            print(json.dumps({"folder": str(folder), "format": form, "views": views}))
        else:
            _print_exported(form, folder, folder / IMAGES, views, home)


@app.command()
def doctor(home: Home = DEFAULT_HOME, as_json: AsJson = False) -> None:
    """Check whether this machine can run aug3d: Python, libraries, disk, memory, GPU; and what to do if not."""
    checks = examine(home)
    if as_json:
        print(json.dumps([check.model_dump() for check in checks], indent=1))
    else:
        marks = {"ok": "[green]ok  [/]", "warn": "[yellow]warn[/]", "fail": "[red]FAIL[/]"}
        for check in checks:
            Console().print(
                f"{marks[check.state]} {check.name:<18} {escape(check.found)}", highlight=False, soft_wrap=True
            )
            if check.state != "ok":
                Console().print(f"     {'':<18} -> {escape(check.remedy)}", highlight=False, soft_wrap=True)
    raise typer.Exit(1 if any(check.state == "fail" for check in checks) else 0)


def _run(
    scene: str, material: Material, preset: str, config: SceneConfig, home: Path, as_json: bool, dry_run: bool
) -> None:
    # Poses and weights that cannot be read are told before anything is started
    stages = material.stages()
    check_weights(config)
    store, console = Store(home), Console(stderr=as_json)
    tell_of_file(console, store, scene, material, preset, config)
    if dry_run:
        print_plan(store, scene, material, config, as_json)
        return
    store.check_writable()  # what would stop it later is told before anything is started
    limits_from(os.environ)
    check_servers()
    apply_local_environment(store.root)
    tell_of_damage(store, scene)
    with store.using():
        # A run that does not fit is refused before a server starts.
        plan = checked_plan(store, scene, material, config, records_before(store, scene))
        console.print(f"everything goes to {store.root}", style="dim", highlight=False, soft_wrap=True, markup=False)
        if metrics := nothing_to_do(store, scene, preset, plan):
            version = Path(metrics["paths"]["metrics"]).parent.name
            console.print(f"nothing changed, nothing was computed: the version of {version}", highlight=False)
        else:
            expected_s = expected_times(store, material, config, plan)
            with following(plan), prefect_server(store.root) as ready:
                metrics = _run_flow(store, scene, material, stages, preset, config, console, ready, expected_s)
    if as_json:
        print(json.dumps(metrics, indent=1))
    else:
        print_summary(Console(), metrics)
        _print_next(scene, home)
    raise typer.Exit(3 if metrics["state"] == "degraded" else 0)


def _run_flow(
    store: Store,
    scene: str,
    material: Material,
    stages: tuple[Stage, ...],
    preset: str,
    config: SceneConfig,
    console: Console,
    server_is_ready: Callable[[], bool],
    expected_s: Mapping[str, float],
) -> dict[str, Any]:
    # Prefect reads its settings when it is imported, so it is imported after they are set.
    from prefect import tags
    from prefect.settings import PREFECT_FLOWS_HEARTBEAT_FREQUENCY, temporary_settings

    from flows.display import Display
    from flows.factory import factory
    from tasks.progress import listening

    # Signs of life are for a server that outlives the run. To end them takes up to a second.
    silent = temporary_settings({PREFECT_FLOWS_HEARTBEAT_FREQUENCY: None} if server_is_ready() else None)
    photos, poses = (str(path) if path else None for path in (material.photos, material.poses))
    with Display(console, stages, expected_s) as display, listening(display), tags(OURS), silent:
        return factory(scene, photos, preset, config, str(store.root), poses)


def _print_failure(metrics: dict[str, Any]) -> None:
    if "failure" in metrics:
        Console().print(
            f"[red]failed[/] {escape(metrics['failure']['problem'])}\n  -> {escape(metrics['failure']['remedy'])}"
        )


def _print_earlier(store: Store, scene: str, home: Path) -> None:
    """Say how to see the newest version that has a tested model, where the last run ended before."""
    metrics = newest_whole(store, scene)
    name = Path(metrics["paths"]["metrics"]).parent.name
    if "nvs" in metrics and name != versions(store, scene)[-1].name:
        print(f"\nnext  {command(home, 'show', f'{scene}@{name}')}   (its newest version with a tested model)")


def _print_next(scene: str, home: Path) -> None:
    print(f"\nnext  {command(home, 'run', 'my_scene', '--photos', 'DIR')}   (your own photographs)")
    print(f"      {command(home, 'predict', scene, '--out', 'view.png')}   (a view that no photograph shows)")
    print(f"      {command(home, 'show', scene)}   (this table again)")
    print(f"      {command(home, 'open', scene)}   (the report, in the browser)")
    print(f"      {command(home, 'up')}   (scenes in a browser, made again by schedule)")


def _print_exported(form: str, folder: Path, images: Path, views: int, home: Path) -> None:
    print(f"{views} undistorted photographs and their poses are in {folder}")
    if form == COLMAP:
        gui = ["colmap", "gui", "--import_path", str(folder / "sparse" / "0"), "--image_path", str(images)]
        print(f"\nnext  {shlex.join(gui)}")
    else:
        print(f"\nnext  ns-train splatfacto --data {shlex.quote(str(folder))}")
    back = command(home, "run", "my_scene", "--photos", images, "--poses", folder)
    print(f"      {back}   (back into aug3d)")


# After a person's first commands, in the order of the help
app.command("open")(open_report)
app.command()(predict)
app.command()(view)
app.command("compare")(compare_runs)
app.command()(up)
app.command()(worker)
app.command()(frames)
app.command()(look)
app.command()(advise)
app.command()(status)
app.command()(gc)
app.command()(verify)
app.add_typer(scenes, name="scenes")
app.add_typer(collections, name="collections")
study.command("tradeoff")(study_tradeoff)
study.command("stability")(study_stability)
study.command("generalisation")(study_generalisation)
app.add_typer(study, name="study")
app.add_typer(bench, name="bench")


@app.callback()
def _begin() -> None:
    """Before every command: what follows, the store's client too, finds secrets in the environment alone."""
    with typed_errors(as_json=False):
        os.environ.update(secrets_read(os.environ))


def main() -> None:
    """Enter from the console script."""
    os.environ.setdefault("PYTHONWARNINGS", "ignore")
    reach_this_machine_directly()
    collect_seldom()
    app()
