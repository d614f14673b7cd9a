"""The published version stays until a newer one is complete and no worse."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from aug3d_core.run.errors import StoreError, UsageError
from aug3d_core.store import layout
from aug3d_core.store.bucket import Bucket
from aug3d_core.store.published import RULES, held_back, publish, published
from aug3d_core.store.scenes import bring_versions, new_version, write_metrics
from aug3d_core.store.seal import sealed
from aug3d_core.store.store import Store


def scored(psnr_db: float, photos: str = "a", state: str = "ok") -> dict[str, Any]:
    return {"state": state, "nvs": {"test_psnr_mean": psnr_db, "test_photos": photos, "conventions": "c"}}


def test_what_is_published_is_found_until_another_is(tmp_path: Path) -> None:
    store = Store(tmp_path)
    assert published(store, "town") is None
    for _ in range(2):
        version = new_version(store, "town")
        write_metrics(version, scored(20.0))
        publish(store, version)
        assert published(store, "town") == version


def test_versions_made_in_one_breath_are_told_apart_and_in_order(tmp_path: Path) -> None:
    names = [new_version(Store(tmp_path), "town").name for _ in range(20)]
    assert names == sorted(set(names))


def test_a_name_cannot_leave_the_folder(tmp_path: Path) -> None:
    store = Store(tmp_path)
    with pytest.raises(UsageError):
        published(store, "../town")
    folder = store.root / layout.SCENES / "town"
    folder.mkdir()
    (folder / layout.PUBLISHED).write_text('{"version": "../../outside"}')
    with pytest.raises(StoreError, match="gone"):
        published(store, "town")


@pytest.mark.parametrize("content", ["", "[]", "{}", "null"])
def test_a_torn_pointer_says_what_to_do(tmp_path: Path, content: str) -> None:
    store = Store(tmp_path)
    (store.root / layout.SCENES / "town").mkdir()
    (store.root / layout.SCENES / "town" / layout.PUBLISHED).write_text(content)
    with pytest.raises(StoreError, match=r"published\.json does not.*\n.*delete /.*published\.json:"):
        published(store, "town")


def test_a_pointer_in_a_shared_store_is_named_where_its_version_is_gone(tmp_path: Path, shared: str) -> None:
    store, pointer = Store(tmp_path), sealed({"version": "2026-01-01"})
    Bucket(shared).put(f"scenes/town/{layout.PUBLISHED}", pointer)
    bring_versions(store, "town")
    with pytest.raises(StoreError) as caught:
        published(store, "town")
    here = store.root / layout.SCENES / "town" / layout.PUBLISHED
    assert f"delete {shared}/scenes/town/published.json and {here}:" in caught.value.remedy
    Bucket(shared).delete([f"scenes/town/{layout.PUBLISHED}"])
    here.unlink()
    bring_versions(store, "town")
    assert published(store, "town") is None


def test_a_version_that_other_machines_cannot_be_told_of_is_not_published_here(
    tmp_path: Path, shared: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    store, version = Store(tmp_path), new_version(Store(tmp_path), "town")
    write_metrics(version, scored(20.0))

    def away(*_: object) -> None:
        raise StoreError("away", "wait")

    monkeypatch.setattr(Bucket, "put", away)
    with pytest.raises(StoreError, match="away"):
        publish(store, version)
    assert published(store, "town") is None


@given(st.floats(5, 50), st.floats(5, 50), st.floats(0, 3))
def test_a_drop_beyond_the_bound_and_no_other_is_held_back(before: float, now: float, bound: float) -> None:
    told = held_back(scored(now), scored(before), bound)
    assert (told is not None) == (before - now > bound)
    if told:
        assert f"{before - now:.2f} dB" in told


def test_what_failed_or_has_no_score_is_never_published() -> None:
    assert "it failed: torn" in (held_back({"failure": {"problem": "torn"}, "state": "refused"}, None, 9.0) or "")
    assert held_back({"state": "ok"}, None, 9.0) == "it has no tested model"
    assert held_back(scored(1.0), None, 0.0) is None


def test_scores_of_other_photographs_are_not_compared() -> None:
    assert held_back(scored(10.0, "b"), scored(20.0, "a"), 0.5) is None
    assert "degraded" in (held_back(scored(30.0, "b", "degraded"), scored(20.0, "a"), 0.5) or "")
    assert held_back(scored(30.0, "b", "degraded"), scored(20.0, "a", "degraded"), 0.5) is None


@pytest.mark.parametrize("rule", RULES)
@pytest.mark.parametrize("of", ["before", "now", "both"])
def test_scores_of_a_test_that_is_not_known_are_not_compared(rule: str, of: str) -> None:
    before, now = scored(20.0), scored(10.0)
    for name, version in (("before", before), ("now", now)):
        if of in (name, "both"):
            version["nvs"][rule] = None
    assert held_back(now, before, 0.5) is None
