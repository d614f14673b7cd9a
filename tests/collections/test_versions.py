"""A version of a collection's model is published unless a scene is worse, or was lost."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from aug3d_core.collections.versions import held_back, model_of
from aug3d_core.run.errors import StoreError, UsageError
from aug3d_core.store import layout
from aug3d_core.store.published import publish, published
from aug3d_core.store.retention import plan
from aug3d_core.store.scenes import new_version, write_metrics
from aug3d_core.store.store import Store


def version(photos: str = "p", untested: dict[str, str] | None = None, **psnr_db: float) -> dict[str, Any]:
    tests = {name: {"test_psnr_mean": db, "test_photos": photos, "conventions": "c"} for name, db in psnr_db.items()}
    return {"tests": tests, "untested": untested or {}, "scenes": {}, "training": {"key": "k"}, "objects": []}


@given(st.floats(5, 50), st.floats(5, 50), st.floats(0, 3))
def test_a_drop_of_one_scene_beyond_the_bound_is_held_back(before: float, now: float, bound: float) -> None:
    told = held_back(version(a=now, b=30.0), version(a=before, b=20.0), bound)
    assert bool(told) == (before - now > bound)
    assert not told or told.startswith("a: PSNR fell")


def test_scores_on_other_photographs_say_nothing() -> None:
    assert held_back(version("q", a=10.0), version("p", a=30.0), 0.5) is None


def test_a_scene_that_was_lost_holds_back_and_one_that_was_taken_out_does_not() -> None:
    before = version(a=20.0, b=20.0)
    assert held_back(version(a=20.0, untested={"b": "it crashed"}), before, 0.5) == "b could not be judged: it crashed"
    assert held_back(version(a=20.0), before, 0.5) is None
    assert held_back(version(), None, 0.5) == "no scene of it has a test"


def test_what_is_published_is_found_until_another_is(tmp_path: Path) -> None:
    store = Store(tmp_path)
    assert published(store, "all", layout.COLLECTIONS) is None
    for _ in range(2):
        folder = new_version(store, "all", layout.COLLECTIONS)
        write_metrics(folder, version(a=20.0))
        publish(store, folder)
        assert published(store, "all", layout.COLLECTIONS) == folder


def test_a_pointer_cannot_leave_the_folder(tmp_path: Path) -> None:
    store = Store(tmp_path)
    folder = new_version(store, "all", layout.COLLECTIONS).parent
    (folder / layout.PUBLISHED).write_text('{"version": "../../outside"}')
    with pytest.raises(StoreError, match="gone"):
        published(store, "all", layout.COLLECTIONS)


def test_without_a_model_the_next_step_is_told(tmp_path: Path) -> None:
    store = Store(tmp_path)
    with pytest.raises(UsageError, match="collections train all"):
        model_of(store, "all")
    write_metrics(new_version(store, "all", layout.COLLECTIONS), version(a=20.0))
    with pytest.raises(StoreError, match="is gone"):
        model_of(store, "all")


def test_what_a_version_is_made_of_is_kept(tmp_path: Path) -> None:
    """aug3d gc drops what nobody names."""
    store = Store(tmp_path)
    for key in ("kept", "loose"):
        (store.root / layout.OBJECTS / "training" / key).mkdir(parents=True)
    write_metrics(new_version(store, "all", layout.COLLECTIONS), version(a=20.0) | {"objects": [["training", "kept"]]})
    assert [waste.folder.name for waste in plan(store, 3, 0.0).goes] == ["loose"]
