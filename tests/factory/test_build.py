"""What an object is made of: its key follows what a stage reads, and nothing else."""

from __future__ import annotations

import errno
import os
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest

from aug3d_core.factory.build import Built, build, work_of
from aug3d_core.factory.config import scene_config
from aug3d_core.factory.material import Material, Source, gather
from aug3d_core.factory.stages import (
    DATASET,
    DEPTH,
    EVALUATION,
    FROM_TOWN,
    MESH_TRUTH,
    OVERLAP,
    SAMPLING,
    STAGES,
    SURFACE,
)
from aug3d_core.groups.files import GROUPS
from aug3d_core.run.errors import StageFailed, StoreError
from aug3d_core.run.files import EARLIER, FILES
from aug3d_core.run.stage import Stage
from aug3d_core.split.files import SPLIT_TABLE
from aug3d_core.store.record import Record
from aug3d_core.store.store import Store
from tests.store.little_store import _FIELDS, add_object

UPSTREAM = ("town", "sfm", "similarity", "depth", "surface", "sampling", "rendering")


def grouping(store: Store, key: str, split: str, groups: str) -> Record:
    """Commit what the stage grouping leaves."""
    files = store.work_dir("grouping", key) / FILES
    files.mkdir(parents=True)
    (files / SPLIT_TABLE).write_text(split)
    (files / GROUPS).write_text(groups)
    return store.commit(files.parent, "grouping", key, dict(_FIELDS))


def keys(store: Store, of: Record) -> dict[str, str]:
    """Return the key of every stage that reads the grouping."""
    others = {name: of.model_copy(update={"stage": name, "digest": name}) for name in UPSTREAM}
    config = scene_config("tiny")

    def key(stage: Stage) -> str:
        sources = gather(store, stage, {**others, "grouping": of}, Material())
        return work_of(stage, getattr(config, stage.name), sources).key

    return {stage.name: key(stage) for stage in (DEPTH, SURFACE, MESH_TRUTH, OVERLAP, SAMPLING, DATASET)}


def test_other_groups_of_the_same_split_leave_depth_and_meshes_as_they_are(tmp_path: Path) -> None:
    store = Store(tmp_path)
    as_it_was = keys(store, grouping(store, "a", "split", "groups of 8"))
    regrouped = keys(store, grouping(store, "b", "split", "groups of 10"))
    split_anew = keys(store, grouping(store, "c", "another split", "groups of 8"))
    same = {name for name, key in as_it_was.items() if regrouped[name] == key}
    assert same == {"depth", "surface", "mesh_truth"}
    assert not set(as_it_was.values()) & set(split_anew.values())


@pytest.mark.parametrize("stage", [stage for stage in STAGES.values() if stage.reads], ids=lambda stage: stage.name)
def test_what_a_stage_reads_is_of_its_inputs(stage: Stage) -> None:
    assert set(stage.reads) <= set(stage.inputs)
    assert stage in FROM_TOWN


def test_what_runs_a_trained_head_is_keyed_by_the_code_of_that_head() -> None:
    head = ("aug3d_core.heads.pixelnerf.head:HEAD",)

    def key(dataset: tuple[str, ...], training: tuple[str, ...]) -> str:
        code = {"dataset": dataset, "training": training}
        sources = {name: Source(path=Path(name), digest=name, modules=modules) for name, modules in code.items()}
        return work_of(EVALUATION, scene_config("tiny").evaluation, sources).key

    assert key((), head) != key((), ())
    assert key(head, ()) == key((), ()), "it reads the data set, and runs nothing of it"


def test_what_is_made_is_found_in_a_store_that_can_only_be_read(
    tmp_path: Path, read_only: Callable[[Path], None]
) -> None:
    store = Store(tmp_path)
    source = Source(path=tmp_path, digest="d")
    made, missing = (work_of(DEPTH, scene_config(size).depth, {"sfm": source}) for size in ("tiny", "small"))
    record = add_object(store, "depth", made.key)
    read_only(tmp_path)
    assert build(store, made, lambda *_: None) == Built(record, cached=True)
    with pytest.raises(StoreError, match="can only be read"):
        build(store, missing, lambda *_: None)


@pytest.mark.parametrize("elsewhere", [True, False])
def test_a_full_disk_is_named_by_the_file_that_could_not_be_written(
    tmp_path: Path, small_disk: Callable[[int], Path], monkeypatch: pytest.MonkeyPatch, elsewhere: bool
) -> None:
    store, other = Store(tmp_path / "home"), small_disk(1)
    work = work_of(DEPTH, scene_config("tiny").depth, {"sfm": Source(path=tmp_path, digest="d")})
    file = (other if elsewhere else store.root) / "tmp1" / "a"

    def full(*_: object) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), str(file))

    monkeypatch.setattr("aug3d_core.factory.build.run_isolated", full)
    with pytest.raises(StageFailed) as caught:
        build(store, work, lambda *_: None)
    assert caught.value.cause == "disk" and str(file) in caught.value.problem
    assert f"no space left on the disk of {other if elsewhere else store.root}:" in caught.value.problem
    assert ("TMPDIR" if elsewhere else "--home") in caught.value.remedy


def test_a_scene_finds_its_own_earlier_work_however_many_others_were_made_since(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    store = Store(tmp_path)
    work = work_of(DEPTH, scene_config("tiny").depth, {"sfm": Source(path=tmp_path, digest="d")})
    own, *_ = [add_object(store, "depth", f"k{number}", recipe=work.recipe) for number in range(12)]
    given = list[list[str]]()

    def computed(_stage: Stage, folder: Path, _progress: object) -> None:
        given.append([one.resolve().parent.name for one in sorted((folder / EARLIER).iterdir())])
        raise StageFailed("depth", "error", "enough is seen", "", "", "")

    monkeypatch.setattr("aug3d_core.factory.build.run_isolated", computed)
    for before in (own, None):
        with pytest.raises(StageFailed):
            build(store, replace(work, before=before), lambda *_: None)
    assert given[0][0] == "k0" and len(given[0]) == 8 and "k0" not in given[1]
    assert replace(work, before=own).key == work.key
