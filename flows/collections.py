"""`aug3d collections`: many scenes and one model over all of them."""

from __future__ import annotations

import json
import os
import time
from collections.abc import Callable
from contextlib import nullcontext
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from rich.console import Console
from rich.markup import escape
from rich.table import Table

from aug3d_core.collections.entry import CollectionEntry
from aug3d_core.collections.files import COLLECTIONS
from aug3d_core.collections.towns import town_works
from aug3d_core.factory.build import build
from aug3d_core.factory.config import AUTO, scene_config
from aug3d_core.run.errors import Aug3dError, StageFailed, StoreError, UsageError
from aug3d_core.run.limits import limits_from
from aug3d_core.scene_files import read_each
from aug3d_core.store import layout
from aug3d_core.store.published import published
from aug3d_core.store.scene_name import check_scene_name
from aug3d_core.store.scenes import bring_report, version_metrics, versions
from aug3d_core.store.store import Store
from flows.options import DEFAULT_HOME, AsJson, Home
from flows.preflight import check_servers, check_weights
from flows.reading import read_store
from flows.refusal import typed_errors
from flows.scenes import any_given, checked_options, confirm_removal, schedule_of, settings_of
from flows.server import prefect_server
from flows.settings import HOME_VARIABLE, OURS, apply_local_environment
from flows.summary import command
from flows.words import widened

if TYPE_CHECKING:
    from aug3d_core.factory.walk import Visit


collections = typer.Typer(no_args_is_help=True, help="Many scenes, one model over all of them: train, judge, publish.")

Name = Annotated[str, typer.Argument(help="Name of the collection: letters, digits, '-' and '_'.")]


@collections.command("add")
def add(
    name: Name,
    train: Annotated[list[str], typer.Option(metavar="SCENE", help="Train on this scene. Repeatable.")] = [],
    hold_out: Annotated[
        list[str], typer.Option(metavar="SCENE", help="Never train on this scene; judge on it. Repeatable.")
    ] = [],
    towns: Annotated[int, typer.Option(min=0, help="Train on so many made-up towns besides.")] = 0,
    towns_seed: Annotated[int, typer.Option(min=0, help="Seed of these towns.")] = 0,
    preset: Annotated[str, typer.Option(help="Size of the training: tiny, small, paper.")] = "tiny",
    set_: Annotated[
        list[str],
        typer.Option(
            "--set", metavar="STAGE.FIELD=VALUE", help="Change a setting of training or evaluation. Repeatable."
        ),
    ] = [],
    description: Annotated[str, typer.Option(help="A sentence for whoever reads a list of collections.")] = "",
    cron: Annotated[str | None, typer.Option(help='Train it by a cron line, e.g. "0 3 * * 1".')] = None,
    every: Annotated[str | None, typer.Option(help="Train it at an interval: 30m, 6h, 1d.")] = None,
    timezone: Annotated[str, typer.Option(help="Time zone of the schedule.")] = "UTC",
    home: Home = DEFAULT_HOME,
    as_json: AsJson = False,
) -> None:
    """Write a collection's file, which you can edit. Nothing is made yet.

    Scenes are those of the registry: aug3d scenes add.
    """
    with typed_errors(as_json, home):
        store = Store(home)
        check_scene_name(name)
        if name in read_each(store):
            raise UsageError(
                f"a scene is called {name!r}", "give the collection another name: --model NAME means either"
            )
        _check_scenes(store, [*train, *hold_out])
        if preset == AUTO:
            raise UsageError(f"--preset {AUTO}: collections take tiny, small or paper", "give one of these")
        entry = checked_options(
            CollectionEntry,
            train=tuple(train),
            hold_out=tuple(hold_out),
            towns=towns,
            towns_seed=towns_seed,
            preset=preset,
            settings=settings_of(preset, set_),
            description=description,
            schedule=schedule_of(None, cron, every, timezone) if any_given(cron, every) else None,
        )
        check_weights(entry.config())
        file = COLLECTIONS.add(store, name, entry)
        if as_json:
            print(json.dumps({"file": str(file), **_facts(store, name, entry)}, indent=1))
        else:
            print(f"{name} is a collection: {file}")
            print(f"\nnext  {command(home, 'collections', 'train', name)}")


@collections.command("list")
def list_all(home: Home = DEFAULT_HOME, as_json: AsJson = False) -> None:
    """List collections, their parts and their last version. A file with a mistake is told, not hidden."""
    with typed_errors(as_json, home):
        store = read_store(home)
        facts = [_facts(store, name, entry) for name, entry in COLLECTIONS.read_each(store).items()]
        if as_json:
            print(json.dumps(facts, indent=1))
            return
        if not facts:
            parts = ("--train", "SCENE", "--hold-out", "SCENE", "--towns", "30")
            print(f"no collection yet; {command(home, 'collections', 'add', 'NAME', *parts)}")
            return
        table = Table("collection", "train", "hold out", "towns", "versions", "published", "trouble")
        for one in facts:
            cells = (one.get("train", ()), one.get("hold_out", ()))
            table.add_row(
                one["collection"],
                *(", ".join(names) or "-" for names in cells),
                str(one.get("towns", "-")),
                str(one["versions"]),
                one["published"] or "-",
                escape(one.get("problem", "")),
            )
        Console().print(table)


@collections.command("show")
def show(name: Name, home: Home = DEFAULT_HOME, as_json: AsJson = False) -> None:
    """Show a collection's parts, and how good its newest model is on each scene."""
    with typed_errors(as_json, home):
        store = read_store(home)
        entry = COLLECTIONS.read(store, name)
        found = versions(store, name, layout.COLLECTIONS)
        metrics = version_metrics(found[-1]) if found else None
        if found:
            bring_report(store, found[-1])
        if as_json:
            print(json.dumps({**_facts(store, name, entry), "metrics": metrics}, indent=1))
            return
        print(f"{name}: {COLLECTIONS.file(store, name)}")
        print(f"  trained on  {', '.join(entry.train) or '-'}{f', {entry.towns} towns' if entry.towns else ''}")
        print(f"  held out    {', '.join(entry.hold_out) or '-'}")
        if metrics is None:
            print(f"\nnext  {command(home, 'collections', 'train', name)}")
        else:
            print_version(found[-1], metrics, published(store, name, layout.COLLECTIONS))


@collections.command("remove")
def remove(
    name: Name,
    yes: Annotated[bool, typer.Option("--yes", help="Do not ask.")] = False,
    home: Home = DEFAULT_HOME,
    as_json: AsJson = False,
) -> None:
    """Remove a collection's file. Its versions, its scenes and all that was made stay."""
    with typed_errors(as_json, home):
        store = read_store(home)
        file = COLLECTIONS.file(store, name)
        confirm_removal(file, len(versions(store, name, layout.COLLECTIONS)), yes, as_json)
        COLLECTIONS.remove(store, name)
        print(json.dumps({"removed": str(file)}) if as_json else f"{file} is removed")


@collections.command("train")
def train(name: Name, home: Home = DEFAULT_HOME, as_json: AsJson = False) -> None:
    """Make the scenes where something changed, train one model on them, and judge it on each.

    Killed half way? Run the same command again. Exit code 3: a scene could not be made, or the model is not published.
    """
    with typed_errors(as_json, home, goes_on=True):
        store = read_store(home)
        store.check_writable()
        check_weights(COLLECTIONS.read(store, name).config())  # a mistake is told before anything is started
        limits_from(os.environ)
        check_servers()
        apply_local_environment(store.root)
        os.environ[HOME_VARIABLE] = str(store.root)
        console = Console(stderr=as_json)
        with store.using(), prefect_server(store.root) as ready:
            message, complete = _run_flow(name, console, ready)
        found = versions(store, name, layout.COLLECTIONS)
        if not found:
            raise StageFailed("training", "refused", message, f"see aug3d collections show {name}", "", "")
        metrics = version_metrics(found[-1])
        if as_json:
            print(json.dumps({"version": str(found[-1]), "message": message, **metrics}, indent=1))
        else:
            print_version(found[-1], metrics, published(store, name, layout.COLLECTIONS))
            print(f"\n{message}")
        raise typer.Exit(0 if complete and metrics["state"] == "ok" else 3)


@collections.command("export")
def export(
    name: Name,
    folder: Annotated[Path, typer.Argument(metavar="DIR", help="New or empty folder to write to.")],
    form: Annotated[
        str,
        typer.Option(
            "--format", help="chunks: pixelSplat, MVSplat, DepthSplat; wai: map-anything; nerfstudio; colmap."
        ),
    ] = "chunks",
    size: Annotated[
        tuple[int, int] | None,
        typer.Option(min=8, metavar="WIDTH HEIGHT", help="Size of the views [px]; without it, as they are packed."),
    ] = None,
    home: Home = DEFAULT_HOME,
    as_json: AsJson = False,
) -> None:
    """Write the data sets of a trained collection for other models: what is trained on, and every test.

    Views are cropped around their centre and shrunk to --size; they never grow.
    """
    with typed_errors(as_json, home):
        from aug3d_core.dataset.files import SCENE_ZARR
        from aug3d_core.dataset.on_disk import Cache
        from aug3d_core.dataset.reader import read
        from aug3d_core.export.packed import export_packed

        store = read_store(home)
        COLLECTIONS.read(store, name)
        found = versions(store, name, layout.COLLECTIONS)
        if not found:
            raise UsageError(f"collection {name!r} was never trained", f"run aug3d collections train {name} first")
        cache, scenes = Cache(2**28), []
        with store.using():
            for scene, told in version_metrics(found[-1])["scenes"].items():
                stage = "exact_town" if told["role"] == "town" else "dataset"
                trained = told["role"] != "hold out"
                # The first of a scene in folds is trained on, and shows what the others hold out
                for data, facts in list(told["data"].items())[: 1 if trained else None]:
                    record = store.find(stage, facts["key"])
                    if record is None:
                        raise StoreError(
                            f"the data set of {scene} is gone from {store.root}", "train the collection again"
                        )
                    scenes.append((data, read(store.files_dir(record) / SCENE_ZARR, cache), trained))
            counts = export_packed(scenes, form, folder, size)
        if as_json:
            print(json.dumps({"folder": str(folder), "format": form, "sequences": counts}))
        else:
            print(f"{counts['train']} sequences to train on and {counts['test']} tests are in {folder}")
            if (told := folder / "README.txt").is_file():
                print(f"How to read their depth: {told}")


@collections.command("towns")
def towns(
    count: Annotated[int, typer.Option(min=1, max=10_000, help="How many.")],
    seed: Annotated[int, typer.Option(min=0, help="Seed of the towns.")] = 0,
    preset: Annotated[str, typer.Option(help="Size of their views: tiny, small, paper.")] = "tiny",
    home: Home = DEFAULT_HOME,
    as_json: AsJson = False,
) -> None:
    """Make towns of every kind as data sets, straight from their truth: what a collection with --towns trains on.

    They differ in plan, buildings, terrain, trees, season, sun, camera, height and flight. Town 7 is the same in 10 as in 100.
    """
    with typed_errors(as_json, home):
        store, console, made = Store(home), Console(stderr=as_json), []
        width_px = scene_config(preset).dataset.width_px
        with store.using(), console.status("") if console.is_terminal else nullcontext() as status:
            for number, (name, work) in enumerate(town_works(count, seed, width_px), start=1):
                if status:
                    status.update(f"town {number} of {count}")
                try:
                    built = build(store, work, lambda done, total, what: None)
                except StageFailed as failure:
                    console.print(f"[yellow]note[/] {name}: {escape(failure.problem)}", highlight=False)
                    continue
                record, town = built.record, work.config.model_dump()["town"]
                made.append(
                    {
                        "town": name,
                        "files": str(store.place(record)),
                        "cached": built.cached,
                        "seconds": record.seconds,
                        **record.metrics,
                        **{field: town[field] for field in ("buildings", "terrain", "season", "path", "altitude_m")},
                    }
                )
                console.print(
                    f"{time.strftime('%H:%M:%S')} [{number}/{count}] {name}: {record.metrics['views']} views of a"
                    f" {town['buildings']} town, {town['season']}, {town['path']} at {town['altitude_m']:.0f} m"
                    f"{', in the store already' if built.cached else f', {record.seconds:.0f} s'}",
                    highlight=False,
                    soft_wrap=True,
                )
        if as_json:
            print(json.dumps(made, indent=1))
        else:
            print(f"{len(made)} towns of {sum(int(one['views']) for one in made)} views are in {store.root}")
            parts = ("--towns", str(count), "--hold-out", "SCENE")
            print(f"\nnext  {command(home, 'collections', 'add', 'NAME', *parts)}")
        raise typer.Exit(0 if len(made) == count else 3)


def _run_flow(name: str, console: Console, server_is_ready: Callable[[], bool]) -> tuple[str, bool]:
    """Run the flow; return what it says, and whether it went well."""
    from prefect import tags
    from prefect.settings import PREFECT_FLOWS_HEARTBEAT_FREQUENCY, temporary_settings

    from flows.collection_run import train_collection
    from tasks.progress import listening

    silent = temporary_settings({PREFECT_FLOWS_HEARTBEAT_FREQUENCY: None} if server_is_ready() else None)
    with listening(_Lines(console)), tags(OURS), silent:
        state = train_collection(name, return_state=True)
    if (state.is_failed() and state.name == "Failed") or state.is_crashed():
        state.result()  # raises what went wrong
    return state.message or "", state.is_completed()


class _Lines:
    """A progress listener: a line for each part of the collection, and what is being made on a terminal."""

    def __init__(self, console: Console) -> None:
        self._console, self._status = console, None

    def started(self, step: str) -> None:
        """A step is told when it is a part of the collection."""

    def advanced(self, step: str, done: int, total: int, what: str) -> None:
        """Print the parts; of the steps in them, how far they are."""
        if step == "collection":
            self._console.print(
                f"{time.strftime('%H:%M:%S')} [{done}/{total}] {what} ...", markup=False, highlight=False
            )
        elif self._console.is_terminal:
            self._console.print(f"         {step}: {done} of {total} {what}", end="\r", markup=False, highlight=False)

    def finished(self, made: Visit) -> None:
        """Nothing is shown."""


def print_version(version: Path, metrics: dict[str, Any], shown: Path | None) -> None:
    """Print how good a version is on each scene."""
    table = Table("scene", "part", title=f"{metrics['collection']}, {version.name}")
    for heading in ("views", "PSNR [dB]", "SSIM", "inputs alone [dB]", "homography", "sweep", "mesh", "blend"):
        table.add_column(heading, justify="right")
    for data, told in metrics["tests"].items():
        alone = told.get("inputs_alone_psnr_mean", told["test_psnr_mean"])
        cheap = [told[f"cheap_{one}"] for one in ("ground_homography", "plane_sweep", "mesh_render", "guided_blend")]
        table.add_row(
            data, told["role"], str(told["test_views"]), f"{told['test_psnr_mean']:.2f}", f"{told['test_ssim_mean']:.3f}",
            f"{alone:.2f}", *(f"{one:.2f}" for one in cheap),
        )  # fmt: skip
    console = widened(Console())
    console.print(table)
    for scene, told in metrics["scenes"].items():
        if "trouble" in told:
            console.print(
                f"[yellow]not made[/] {scene}: {escape(told['trouble'])}\n  -> {escape(told['remedy'])}",
                highlight=False,
            )
    for data, why in metrics["untested"].items():
        console.print(f"[yellow]not judged[/] {data}: {escape(why)}", highlight=False)
    for note in metrics["notes"]:
        console.print(f"[yellow]note[/] {escape(note)}", highlight=False)
    print(f"published: {shown.name if shown else 'none'}")
    print(f"report   {version / layout.REPORT}")


def _check_scenes(store: Store, names: list[str]) -> None:
    known = read_each(store)
    if unknown := [name for name in names if name not in known]:
        raise UsageError(
            f"scene {unknown[0]!r} is not registered",
            f"registered scenes: {', '.join(known) or 'none yet'}; add it with aug3d scenes add",
        )


def _facts(store: Store, name: str, entry: CollectionEntry | Aug3dError) -> dict[str, Any]:
    found, shown = versions(store, name, layout.COLLECTIONS), published(store, name, layout.COLLECTIONS)
    made = {"versions": len(found), "published": shown.name if shown else None}
    if isinstance(entry, Aug3dError):
        return {"collection": name, "problem": entry.problem, "remedy": entry.remedy, **made}
    return {"collection": name, **entry.model_dump(mode="json"), **made}
