"""`aug3d gc`: give back the disk that no version of a scene and no study needs."""

from __future__ import annotations

import json
import shutil
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Annotated, Any

import typer
from rich.console import Console
from rich.table import Table

from aug3d_core.collections.files import COLLECTIONS
from aug3d_core.run.errors import UsageError
from aug3d_core.scene_files.files import read_each
from aug3d_core.store.retention import Plan, Waste, drop, plan, plan_for_scene
from aug3d_core.store.scene_name import check_scene_name
from aug3d_core.store.store import Store
from aug3d_core.store.usage import Usage, besides, usage
from flows.options import DEFAULT_HOME, AsJson, Home
from flows.reading import read_store
from flows.refusal import typed_errors
from flows.summary import command

if TYPE_CHECKING:
    from aug3d_core.store.sweep import Loose, Sweep


def gc(
    scene: Annotated[
        str | None,
        typer.Option(
            "--scene",
            help="Drop everything of this scene or collection instead: versions, studies, what only they need.",
        ),
    ] = None,
    keep: Annotated[
        int, typer.Option(min=1, help="Newest versions that each scene or collection keeps, beside the published one.")
    ] = 3,
    keep_hours: Annotated[
        float,
        typer.Option(min=0.0, help="Keep for so long what no version names: a killed run may go on from it, hours."),
    ] = 24.0,
    dry_run: Annotated[bool, typer.Option("--dry-run", help="Say what would go and what stays, and stop.")] = False,
    yes: Annotated[bool, typer.Option("--yes", help="Drop a whole scene without asking.")] = False,
    home: Home = DEFAULT_HOME,
    as_json: AsJson = False,
) -> None:
    """Drop what no version of a scene or a collection and no study needs, and show what each takes on the disk.

    Each scene and collection keeps its published version, its newest ones and the newest that did not fail. Predictions go:
    --out kept them.
    In a store that several machines share, objects go at a later look: once nobody has needed them for --keep-hours.
    """
    with typed_errors(as_json, home):
        store = read_store(home)
        if scene is not None:
            check_scene_name(scene)
        there = _look(store, scene, keep, keep_hours) if dry_run or scene is not None else None
        goes = _plan(store, scene, keep, keep_hours, there)
        if dry_run:
            _tell(store, goes, there, _free(store), as_json, dry_run)
            return
        store.check_writable()  # before anything is asked
        if scene is not None and not yes:
            _ask(store, scene, [*goes.goes, *(there.goes if there else ())], as_json)
        before = _free(store)
        with store.alone():
            if store.shared is not None:
                from aug3d_core.store.sweep import sweep

                there = sweep(store.shared.bucket, store.root, keep, keep_hours, scene)
            goes = _plan(store, scene, keep, keep_hours, there)  # a run may have ended since the first look
            drop(store, goes.goes)
        _tell(store, goes, there, before, as_json, dry_run)


def _look(store: Store, scene: str | None, keep: int, keep_hours: float) -> Sweep | None:
    """Return what may go from the store that several machines share, None if there is none."""
    if store.shared is None:
        return None
    from aug3d_core.store.census import census
    from aug3d_core.store.sweep import look

    return look(census(store.shared.bucket, store.root), keep, keep_hours, scene)


def _plan(store: Store, scene: str | None, keep: int, keep_hours: float, there: Sweep | None) -> Plan:
    if scene is None:
        return plan(store, keep, keep_hours)
    if there and any(waste.scene == scene for waste in there.goes) and scene not in usage(store):
        return Plan(())  # this machine has nothing of it
    return plan_for_scene(store, scene)


def _ask(store: Store, scene: str, goes: Sequence[Waste | Loose], as_json: bool) -> None:
    if as_json:
        raise UsageError(f"--json cannot ask whether all of scene {scene!r} may go", "add --yes")
    console = Console()
    console.print(_waste_table(f"all of {scene}", goes))
    if scene in read_each(store):
        remove = command(store.root, "scenes", "remove", scene)
        console.print(
            f"it stays in the registry, to be made again; to end that: {remove}", highlight=False, soft_wrap=True
        )
    typer.confirm("Drop all of this? What MLflow holds of it stays.", abort=True)


def _tell(store: Store, goes: Plan, there: Sweep | None, free_before: int, as_json: bool, dry_run: bool) -> None:
    takes, freed = usage(store), _bytes(goes.goes)
    free_after = free_before + freed if dry_run else _free(store)
    registered, rest = {*read_each(store), *COLLECTIONS.read_each(store)}, besides(store)
    strays = [scene for scene in takes if scene not in registered]
    if as_json:
        told = {
            "dry_run": dry_run,
            "goes": _rows(goes.goes),
            "bytes": freed,
            "young": {"count": len(goes.young), "bytes": _bytes(goes.young)},
            "scenes": {scene: vars(used) for scene, used in takes.items()},
            "besides": rest,
            "not_registered": strays,
            "free_bytes": {"before": free_before, "after": free_after},
        } | ({"shared": _told_of_shared(there)} if there else {})
        print(json.dumps(told, indent=1))
        return
    console = Console()
    if goes.goes:
        console.print(_waste_table("what would go" if dry_run else "gone", goes.goes))
    else:
        console.print("nothing would go" if dry_run else "nothing had to go")
    console.print(usage_table(takes))
    lines = [
        f"besides  {', '.join(f'{what} {_mib(size)} MiB' for what, size in rest.items() if size) or 'nothing'}",
        f"free on the disk  {_mib(free_before)} MiB; {'it would be' if dry_run else 'now'} {_mib(free_after)} MiB",
    ]
    if goes.young:
        lines.append(
            f"{_mib(_bytes(goes.young))} MiB in {len(goes.young)} folders are no version's, but new: a killed run or study"
            " may go on from them; --keep-hours 0 drops them"
        )
    if strays:
        lines.append(
            f"not in the registry: {', '.join(strays)}; {command(store.root, 'gc', '--scene', 'NAME')} drops all of one"
        )
    for line in lines:
        console.print(line, highlight=False, soft_wrap=True)
    if there:
        _tell_of_shared(console, there, dry_run)


def _tell_of_shared(console: Console, there: Sweep, dry_run: bool) -> None:
    told = _told_of_shared(there)
    where = told["url"]
    if there.goes:
        console.print(_waste_table(f"{'what would go' if dry_run else 'gone'} from {where}", there.goes))
    console.print(usage_table(_usage_of(there), f"in {where}"))
    lines = [f"in all  {told['objects']:,} objects, {_mib(told['store_bytes'])} MiB; {_mib(told['bytes'])} MiB go now"]
    if there.waits:
        lines.append(
            f"{_mib(told['waits']['bytes'])} MiB in {told['waits']['count']} parts are needed by no version or study of any"
            " machine; they go at a later aug3d gc if that stays so"
        )
    for line in lines:
        console.print(line, highlight=False, soft_wrap=True)


def _told_of_shared(there: Sweep) -> dict[str, Any]:
    found = there.found
    return {
        "url": found.bucket.url,
        "objects": len(found.objects),
        "store_bytes": sum(entry.size_bytes for entry in found.entries),  # before anything went
        "goes": _rows(there.goes),
        "bytes": _bytes(there.goes),
        "waits": {"count": len(there.waits), "bytes": _bytes(there.waits)},
        "scenes": {scene: vars(used) for scene, used in _usage_of(there).items()},
    }


def _usage_of(there: Sweep) -> dict[str, Usage]:
    return there.found.usage({waste.folder for waste in there.goes if waste.folder})


def usage_table(takes: Mapping[str, Usage], title: str = "on the disk") -> Table:
    """Return what each scene takes as a table."""
    table = Table("scene", title=title)
    for heading in ("versions", "studies", "its own MiB", "shared MiB"):
        table.add_column(heading, justify="right")
    for scene, used in takes.items():
        figures = (str(used.versions), str(used.studies), _mib(used.own_bytes), _mib(used.shared_bytes))
        table.add_row(scene, *figures)
    return table


def _waste_table(title: str, goes: Sequence[Waste | Loose]) -> Table:
    table = Table("scene", "what", title=title, show_footer=True)
    table.columns[0].footer = "together"
    table.add_column("count", str(len(goes)), justify="right")
    table.add_column("MiB", _mib(_bytes(goes)), justify="right")
    for scene, what, count, size_bytes in _summed(goes):
        table.add_row(scene or "-", what, str(count), _mib(size_bytes))
    return table


def _rows(goes: Sequence[Waste | Loose]) -> list[dict[str, Any]]:
    return [{"scene": s or None, "what": w, "count": c, "bytes": b} for s, w, c, b in _summed(goes)]


def _summed(goes: Sequence[Waste | Loose]) -> list[tuple[str, str, int, int]]:
    """Return scene, what, count and bytes of what goes together."""
    groups: dict[tuple[str, str], list[Waste | Loose]] = {}
    for waste in goes:
        groups.setdefault((waste.scene, waste.what), []).append(waste)
    return [(*group, len(rows), _bytes(rows)) for group, rows in sorted(groups.items())]


def _bytes(goes: Sequence[Waste | Loose]) -> int:
    return sum(waste.size_bytes for waste in goes)


def _free(store: Store) -> int:
    return shutil.disk_usage(store.root).free


def _mib(size_bytes: int) -> str:
    return f"{size_bytes / 2**20:,.1f}"
