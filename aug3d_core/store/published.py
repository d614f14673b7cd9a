"""The version of a scene or a collection that others use: it stays until a newer one is complete and no worse."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any

from aug3d_core.run.atomic_file import write_synced
from aug3d_core.run.errors import StoreError
from aug3d_core.store import layout
from aug3d_core.store.scene_name import check_scene_name
from aug3d_core.store.seal import sealed, unsealed
from aug3d_core.store.store import Store

RULES = ("test_photos", "conventions")  # what two scores must have in common to be compared


def published(store: Store, name: str, top: str = layout.SCENES) -> Path | None:
    """Return the folder of the published version of a scene, or of a collection; None if there is none.

    top: `layout.SCENES` or `layout.COLLECTIONS`. Raises StoreError if it is named and gone.
    """
    pointer = store.root / top / check_scene_name(name) / layout.PUBLISHED
    try:
        told = unsealed(pointer.read_bytes())["version"]
    except FileNotFoundError:
        return None
    except (ValueError, KeyError, TypeError) as error:
        raise StoreError(f"{pointer} does not name a version", _delete(store, pointer)) from error
    version = pointer.parent / Path(str(told)).name
    if not (version / layout.METRICS).is_file():
        of = "scene" if top == layout.SCENES else "collection"
        raise StoreError(f"the published version {told} of {of} {name!r} is gone", _delete(store, pointer))
    return version


def publish(store: Store, version: Path) -> None:
    """Name a complete version as the one to use; the one before stays on the disk until `aug3d gc`."""
    pointer, content = version.parent / layout.PUBLISHED, sealed({"version": version.name})
    if store.shared is not None:
        store.shared.share_pointer(pointer, content)  # first: a version that is published here counts as done
    write_synced(pointer, content)


def names(pointer: Path, version: Path) -> bool:
    """Say whether a pointer is there, can be read, and names this version."""
    with suppress(OSError, ValueError, KeyError, TypeError):
        return unsealed(pointer.read_bytes())["version"] == version.name
    return False


def held_back(metrics: Mapping[str, Any], before: Mapping[str, Any] | None, most_psnr_drop_db: float) -> str | None:
    """Return why a version must not replace the published one, or None if it may.

    Both are what their `metrics.json` holds. A version that failed, or that tested no model, is never published. Scores on
    other test photographs, or on some that are not known, say nothing about each other: then a degraded version does not
    replace one that is ok.
    """
    if "failure" in metrics:
        return f"it failed: {metrics['failure']['problem']}"
    now = metrics.get("nvs")
    if now is None:
        return "it has no tested model"
    then = (before or {}).get("nvs")
    if before is None or then is None:
        return None
    if any(not now.get(rule) or now[rule] != then.get(rule) for rule in RULES):
        worse = (metrics["state"], before["state"]) == ("degraded", "ok")
        return (
            "it is degraded, the published version is ok, and their scores are of other photographs" if worse else None
        )
    return psnr_fell(then["test_psnr_mean"], now["test_psnr_mean"], most_psnr_drop_db)


def psnr_fell(then_db: float, now_db: float, most_psnr_drop_db: float) -> str | None:
    """Return by how much the PSNR of a test fell where that is more than may be lost, None otherwise."""
    drop_db = then_db - now_db
    if drop_db > most_psnr_drop_db:
        return (
            f"PSNR fell by {drop_db:.2f} dB, from {then_db:.2f} to {now_db:.2f} dB;"
            f" at most {most_psnr_drop_db:g} dB may be lost"
        )
    return None


def _delete(store: Store, pointer: Path) -> str:
    """Return what to do about a pointer; the one in a shared store would come here again."""
    there = f"{store.shared.bucket.url}/{pointer.relative_to(store.root).as_posix()} and " if store.shared else ""
    return f"delete {there}{pointer}: the next good version is then published"
