"""`aug3d scenes`: the registry of scenes - where photographs are, how a scene is made, and when by itself."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Any, TypeVar

import typer
from pydantic import BaseModel, ValidationError
from rich.console import Console

from aug3d_core.collections.files import COLLECTIONS
from aug3d_core.factory.config import SIZES, said, scene_config
from aug3d_core.run.errors import UsageError
from aug3d_core.run.nested import nested, value_at
from aug3d_core.scene_files import (
    SceneEntry,
    Schedule,
    read_each,
    read_scene,
    remove_scene,
    scene_file,
    write_scene,
    write_schedule,
)
from aug3d_core.store.scenes import scenes as made_scenes
from aug3d_core.store.scenes import versions
from aug3d_core.store.store import Store
from flows.options import DEFAULT_HOME, AsJson, Home
from flows.preflight import check_weights
from flows.reading import read_store
from flows.refusal import check_photos, typed_errors
from flows.scene_facts import scene_facts
from flows.scene_tables import moment, print_scene, print_scenes
from flows.summary import command

Model = TypeVar("Model", bound=BaseModel)

scenes = typer.Typer(
    no_args_is_help=True, help="The registry: where each scene's photographs are, how and when to make it."
)

Scene = Annotated[str, typer.Argument(help="Name of the scene: letters, digits, '-' and '_'.")]
Cron = Annotated[
    str | None, typer.Option(help='Make it by a cron line: minute hour day month weekday, e.g. "0 3 * * 1".')
]
Every = Annotated[str | None, typer.Option(help="Make it at an interval: 30m, 6h, 1d.")]
Timezone = Annotated[str | None, typer.Option(help="Time zone of the schedule, e.g. Europe/Warsaw. Without it, UTC.")]


@scenes.command("add")
def add_scene(
    scene: Scene,
    photos: Annotated[
        Path | None, typer.Option(help="Folder of photographs (JPEG, PNG, TIFF; subfolders too).")
    ] = None,
    town: Annotated[bool, typer.Option("--town", help="Instead of photographs: the built-in town.")] = False,
    poses: Annotated[
        Path | None, typer.Option(help="Take camera poses from here: COLMAP, nerfstudio, Mega-NeRF.")
    ] = None,
    preset: Annotated[str, typer.Option(help=SIZES)] = "tiny",
    set_: Annotated[
        list[str], typer.Option("--set", metavar="STAGE.FIELD=VALUE", help="Change one setting. Repeatable.")
    ] = [],
    licence: Annotated[str | None, typer.Option(help="Terms under which the photographs may be used.")] = None,
    description: Annotated[str, typer.Option(help="A sentence for whoever reads a list of scenes.")] = "",
    tag: Annotated[list[str], typer.Option(help="A word to find it by. Repeatable.")] = [],
    cron: Cron = None,
    every: Every = None,
    timezone: Timezone = None,
    home: Home = DEFAULT_HOME,
    as_json: AsJson = False,
) -> None:
    """Put a scene into the registry: one commented file that you can edit. Nothing is made yet."""
    with typed_errors(as_json, home):
        _check_source(photos, town)
        entry = checked_options(
            SceneEntry,
            photos=photos,
            poses=poses,
            preset=preset,
            settings=settings_of(preset, set_),
            licence=licence,
            description=description,
            tags=tuple(tag),
            schedule=schedule_of(None, cron, every, timezone) if any_given(cron, every, timezone) else None,
        )
        entry.material().stages()  # poses that cannot be read are told now
        check_weights(entry.config())
        store = Store(home)
        if scene in COLLECTIONS.read_each(store):
            raise UsageError(
                f"a collection is called {scene!r}", "give the scene another name: --model NAME means either"
            )
        file = write_scene(store, scene, entry)
        if as_json:
            print(json.dumps({"file": str(file), **scene_facts(store, scene, entry)}, indent=1))
        else:
            _print_added(scene, entry, file, home)


@scenes.command("list")
def list_scenes(home: Home = DEFAULT_HOME, as_json: AsJson = False) -> None:
    """List every scene: photographs, schedule, last and published version. A file with a mistake is told, not hidden."""
    with typed_errors(as_json, home):
        store = read_store(home)
        made = made_scenes(store)
        facts = [scene_facts(store, scene, entry) for scene, entry in read_each(store).items()]
        others = sorted(set(made) - {fact["scene"] for fact in facts})
        if as_json:
            print(json.dumps({"scenes": facts, "not_in_the_registry": others}, indent=1))
        else:
            print_scenes(Console(), facts, others, home)


@scenes.command("show")
def show_scene(scene: Scene, home: Home = DEFAULT_HOME, as_json: AsJson = False) -> None:
    """Show what the registry says of a scene, the settings that differ from the preset's, and its versions."""
    with typed_errors(as_json, home):
        store = read_store(home)
        facts = {"file": str(scene_file(store, scene)), **scene_facts(store, scene, read_scene(store, scene))}
        if as_json:
            print(json.dumps(facts, indent=1))
        else:
            print_scene(Console(), facts)


@scenes.command("remove")
def drop_scene(
    scene: Scene,
    yes: Annotated[bool, typer.Option("--yes", help="Do not ask.")] = False,
    home: Home = DEFAULT_HOME,
    as_json: AsJson = False,
) -> None:
    """Remove a scene from the registry. Its versions, and all that was made for them, stay."""
    with typed_errors(as_json, home):
        store = read_store(home)
        file = scene_file(store, scene)
        kept = len(versions(store, scene))
        confirm_removal(file, kept, yes, as_json)
        remove_scene(store, scene)
        if as_json:
            print(json.dumps({"removed": str(file), "versions": kept}))
            return
        print(f"{file} is removed")
        if kept:
            print(f"its {_counted(kept)} and what was made for it stay")
            print(f"\nnext  {command(home, 'gc', '--scene', scene)}   (drop these, too)")


@scenes.command("schedule")
def schedule_scene(
    scene: Scene,
    cron: Cron = None,
    every: Every = None,
    timezone: Timezone = None,
    off: Annotated[bool, typer.Option("--off", help="Make it when asked only.")] = False,
    pause: Annotated[
        bool | None, typer.Option("--pause/--resume", help="Hold the schedule, or let it go on.", show_default=False)
    ] = None,
    home: Home = DEFAULT_HOME,
    as_json: AsJson = False,
) -> None:
    """Change when a scene is made again by itself. The rest of its file, comments too, stays as it is."""
    with typed_errors(as_json, home):
        changed = any_given(cron, every, timezone)
        if [changed, off, pause is not None].count(True) != 1:
            raise UsageError(
                "say one thing about the schedule", 'give --cron "0 3 * * 1" or --every 6h, --off, --pause or --resume'
            )
        store = read_store(home)
        now = read_scene(store, scene).schedule
        if changed:
            now = schedule_of(now, cron, every, timezone)
        elif off:
            now = None
        elif now:
            now = now.model_copy(update={"paused": bool(pause)})
        else:
            raise UsageError(f"scene {scene!r} has no schedule", "give it one with --cron or --every")
        facts = scene_facts(store, scene, write_schedule(store, scene, now))
        if as_json:
            print(json.dumps({name: facts[name] for name in ("scene", "schedule", "when", "next")}, indent=1))
        else:
            print(f"{scene}: {facts['when']}{f', next {moment(facts)}' if facts['next'] else ''}")


def confirm_removal(file: Path, kept: int, yes: bool, as_json: bool) -> None:
    """Ask whether a file of a registry is to go. kept: so many versions of it stay. yes: nobody is asked."""
    if yes:
        return
    if as_json:
        raise UsageError("--json asks nothing", "give --yes, too")
    typer.confirm(f"Remove {file}? (Its {_counted(kept)} would stay.)", abort=True)


def any_given(*options: str | None) -> bool:
    return any(option is not None for option in options)  # an empty one is wrong, not left out


def _counted(versions: int) -> str:
    return "1 version" if versions == 1 else f"{versions} versions"


def _check_source(photos: Path | None, town: bool) -> None:
    if (photos is None) != town:
        raise UsageError("a scene is made of photographs or of the town", "give either --photos DIR or --town")
    if photos:
        check_photos(photos)


def settings_of(preset: str, overrides: list[str]) -> dict[str, dict[str, Any]]:
    """Return overrides of the form `stage.field=value` as the registry holds them, checked and typed."""
    config = scene_config(preset, overrides).model_dump(mode="json")
    paths = [override.partition("=")[0] for override in overrides]
    chosen = {path: value_at(config, path) for path in paths if path != "training.head"}
    return nested(
        ({"training.head.name": config["training"]["head"]["name"]} if "training.head" in paths else {}) | chosen
    )


def schedule_of(now: Schedule | None, cron: str | None, every: str | None, timezone: str | None) -> Schedule:
    """Return the schedule with what was said of it changed; raises UsageError."""
    if cron is not None and every is not None:
        raise UsageError("a schedule takes --cron or --every, not both", "give one of them")
    if now is None and not any_given(cron, every):
        raise UsageError("a schedule needs --cron or --every", 'give for example --cron "0 3 * * 1" or --every 6h')
    values = now.model_dump() if now else {}
    if any_given(cron, every):
        values |= {"cron": cron, "every": every}
    if timezone is not None:
        values["timezone"] = timezone
    return checked_options(Schedule, **values)


def checked_options(model: type[Model], **values: Any) -> Model:
    """Return a value made of options; raises UsageError that names the wrong ones."""
    try:
        return model(**values)
    except ValidationError as error:
        wrong = [f"{_option(e['loc'], e['input'])}{said(e)}" for e in error.errors()]
        raise UsageError("; ".join(wrong), "see the command's --help") from error


def _option(loc: Sequence[int | str], value: Any) -> str:
    """Return an option as it was given; "" where several are wrong together."""
    if not loc:
        return ""
    name = {"settings": "set", "tags": "tag"}.get(str(loc[0]), str(loc[0]))
    return f"--{name.replace('_', '-')} {value!r}: "


def _print_added(scene: str, entry: SceneEntry, file: Path, home: Path) -> None:
    print(f"{scene} is in the registry: {file}")
    print(f"\nnext  {command(home, 'scenes', 'show', scene)}   (what it says)")
    print(f"      {command(home, 'run', scene)}   (make it now)")
    if entry.schedule is None:
        monday = command(home, "scenes", "schedule", scene, "--cron", "0 3 * * 1")
        print(f"      {monday}   (make it again every Monday)")
    print(f"      {command(home, 'up')}   (make it in the browser, and by its schedule)")
