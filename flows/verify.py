"""`aug3d verify`: read a whole store, name what is damaged, and make it again."""

from __future__ import annotations

import json
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import asdict
from typing import Annotated, Any

import typer
from rich.console import Console
from rich.markup import escape
from rich.progress import BarColumn, DownloadColumn, Progress, TextColumn, TimeRemainingColumn, TransferSpeedColumn

from aug3d_core.run.errors import Aug3dError, UsageError
from aug3d_core.store import layout
from aug3d_core.store.published import names
from aug3d_core.store.store import Store
from aug3d_core.store.verification import Damage, OnBytes, damaged, items_of, size_of
from flows.options import DEFAULT_HOME, AsJson, Home
from flows.reading import read_store
from flows.refusal import typed_errors


def verify(
    scene: Annotated[
        str | None,
        typer.Argument(help="Only what the versions and studies of this scene need; without it, everything."),
    ] = None,
    repair: Annotated[
        bool, typer.Option("--repair", help="Put what is damaged aside, and make objects again as they were made.")
    ] = False,
    home: Home = DEFAULT_HOME,
    as_json: AsJson = False,
) -> None:
    """Read every object and version, and compare each file with the digest that was taken when it was written.

    Disks lose bits without a word, and a file's size and time tell nothing. Of a store that several machines share, all that
    is in it is read too. Exit code 3: something is damaged.
    """
    with typed_errors(as_json, home):
        console, store, started = Console(stderr=as_json), read_store(home), time.monotonic()
        if repair:
            store.check_writable()
        with store.using():
            store.bring_versions(layout.SCENES, scene)
            items = items_of(store, scene)
            if scene is not None and not items:
                raise UsageError(f"no version or study of {scene!r} is in {store.root}", "see aug3d gc --dry-run")
            size = size_of(store, items)
            with _shown(console, size) as on_bytes:
                found = [*_shipped(), *damaged(store, scene, items, on_bytes)]
        told: dict[str, Any] = {
            "objects": len(items),
            "bytes": size,
            "seconds": round(time.monotonic() - started, 2),
            "damaged": [{**asdict(one), "path": str(one.path), "repaired": None} for one in found],
        }
        _say_read(console, "", told)
        for one, line in zip(found, told["damaged"], strict=True):
            _say_damaged(console, str(one.path), one.what, one.needed_by)
            if repair:
                line["repaired"], said = _repaired(store, one)
                console.print(f"  {said}", highlight=False, soft_wrap=True, markup=False)
        if store.shared is not None:
            told["shared"] = _shared(console, store, scene, repair)
        damage = [*told["damaged"], *told.get("shared", {}).get("damaged", ())]
        if damage and not repair:
            console.print("\nnext  aug3d verify --repair", highlight=False)
        if as_json:
            print(json.dumps(told, indent=1))
        raise typer.Exit(3 if any(not line["repaired"] for line in damage) else 0)


def _shared(console: Console, store: Store, scene: str | None, repair: bool) -> dict[str, Any]:
    """Verify the store that several machines share, and repair it; return what `--json` tells of it."""
    from aug3d_core.store.census import census
    from aug3d_core.store.shared_verification import damaged_there, readable, repair_there

    assert store.shared is not None
    bucket, started = store.shared.bucket, time.monotonic()
    seen = readable(census(bucket, None), scene)
    with _shown(console, seen.size_bytes) as on_bytes:
        found = list(damaged_there(bucket, seen, on_bytes))
    told: dict[str, Any] = {
        "objects": len(seen.records),
        "bytes": seen.size_bytes,
        "seconds": round(time.monotonic() - started, 2),
        "damaged": [
            {"path": f"{bucket.url}/{one.name}", "what": one.what, "needed_by": one.needed_by, "repaired": None}
            for one in found
        ],
    }
    _say_read(console, f" of {bucket.url}", told)
    for one, line in zip(found, told["damaged"], strict=True):
        _say_damaged(console, line["path"], one.what, one.needed_by)
        if repair:
            said, line["repaired"] = repair_there(store, seen, one), True
            console.print(f"  {said}", highlight=False, soft_wrap=True, markup=False)
    return told


def _say_read(console: Console, of: str, told: dict[str, Any]) -> None:
    console.print(
        f"{told['objects']} objects{of}, {told['bytes'] / 2**20:,.0f} MiB read in {told['seconds']:.1f} s:"
        f" {len(told['damaged']) or 'nothing'} damaged",
        highlight=False,
        soft_wrap=True,
    )


def _say_damaged(console: Console, path: str, what: str, needed_by: tuple[str, ...]) -> None:
    needed = f"; needed by {', '.join(needed_by)}" if needed_by else ""
    console.print(f"[red]damaged[/] {escape(f'{path}: {what}{needed}')}", highlight=False, soft_wrap=True)


@contextmanager
def _shown(console: Console, size: int) -> Iterator[OnBytes]:
    columns = (TextColumn("reading"), BarColumn(), DownloadColumn(), TransferSpeedColumn(), TimeRemainingColumn())
    with Progress(*columns, console=console, disable=not console.is_terminal, transient=True) as bars:
        row = bars.add_task("", total=size)
        yield lambda count: bars.advance(row, count)


def _shipped() -> list[Damage]:
    """Say whether the weights that aug3d ships are what was shipped."""
    from aug3d_core.heads.config import shipped
    from aug3d_core.heads.files import MODEL_WEIGHTS
    from aug3d_core.run.digest import file_digest

    folder, digest, _ = shipped()
    try:
        whole = file_digest(folder / MODEL_WEIGHTS) == digest
    except OSError:
        whole = False
    return [] if whole else [Damage(folder / MODEL_WEIGHTS, "is not what aug3d ships: install aug3d again")]


def _repaired(store: Store, one: Damage) -> tuple[bool, str]:
    """Repair one thing; say whether it is whole now, and what was done."""
    from aug3d_core.factory.repair import repair

    if not one.path.is_relative_to(store.root):
        return False, "aug3d cannot make it again"
    if one.item is None:
        aside = one.path.with_name(f"{layout.DAMAGED}{one.path.name}-{time.time_ns()}")
        one.path.rename(aside)
        if names(pointer := one.path.parent / layout.PUBLISHED, one.path):
            pointer.unlink()
        return True, f"put aside: {aside}; run the scene again to have another"
    try:
        built = repair(store, one.item, lambda *_: None)
    except Aug3dError as error:
        return False, f"{error.problem}; {error.remedy}"
    return True, built.damage or "it was made again"
