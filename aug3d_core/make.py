"""Make one object, or find it made: key, lock, isolated run, commit."""

from __future__ import annotations

import shutil
from collections.abc import Mapping, Sequence
from contextlib import nullcontext
from pathlib import Path

from aug3d_core.errors import StageFailed
from aug3d_core.formats.recognise import pose_digest, recognise
from aug3d_core.isolation import run_isolated
from aug3d_core.photos.discover import folder_digest
from aug3d_core.side_reports import on_the_side
from aug3d_core.stage import Frozen, Outcome, Progress, Stage, StageConfig
from aug3d_core.stage_main import Job
from aug3d_core.stages import FROM_MODEL, FROM_PHOTOS, FROM_POSES, FROM_TOWN
from aug3d_core.store import layout
from aug3d_core.store.keys import engine_versions, object_key, recipe
from aug3d_core.store.record import Record, files_digest
from aug3d_core.store.store import Store, disk_full, write_synced

_MOST_EARLIER = 8  # outputs of a stage's recipe that it may look at for work to reuse


class Source(Frozen):
    """An input of a stage: a folder of files, and the digest of what is in it."""

    path: Path
    digest: str


def source_of(store: Store, record: Record, reads: Sequence[str] = ()) -> Source:
    """Return a finished object as the input of a stage. reads: the only files that the stage reads of it, empty for all."""
    digest = files_digest({name: record.files[name] for name in reads}) if reads else record.digest
    return Source(path=store.files_dir(record), digest=digest)


class Material(Frozen):
    """What the user gives: a folder of photographs, None for the built-in town; and poses of them, None to find them."""

    photos: Path | None = None
    poses: Path | None = None

    def stages(self) -> tuple[Stage, ...]:
        """Return the stages that make a scene of it; raises InputError if the poses are of no known kind."""
        if self.photos is None:
            return FROM_TOWN
        if self.poses is None:
            return FROM_PHOTOS
        return FROM_MODEL if recognise(self.poses).has_points else FROM_POSES


def gather(store: Store, stage: Stage, records: Mapping[str, Record], material: Material) -> dict[str, Source]:
    """Return the inputs of a stage from the records so far, and from what the user gave."""
    return {name: _source(store, stage, name, records, material) for name in stage.inputs}


def ready(stage: Stage, records: Mapping[str, Record], material: Material) -> bool:
    """Say whether all inputs of a stage are there."""
    there = {*records, "given", *(["folder"] if material.photos or "town" in records else [])}
    return there.issuperset(stage.inputs)


def _source(store: Store, stage: Stage, name: str, records: Mapping[str, Record], material: Material) -> Source:
    if name == "folder":
        folder = material.photos or store.files_dir(records["town"]) / layout.TOWN_PHOTOS
        return Source(path=folder, digest=folder_digest(folder))
    if name == "given" and material.poses:
        return Source(path=material.poses, digest=pose_digest(material.poses))
    return source_of(store, records[name], stage.reads.get(name, ()))


def key_of(stage: Stage, config: StageConfig, sources: Mapping[str, Source]) -> str:
    """Return the key of the object that these inputs make."""
    return object_key(stage, config, {name: source.digest for name, source in sources.items()})


def make(store: Store, stage: Stage, config: StageConfig, sources: Mapping[str, Source], progress: Progress) -> Record:
    """Return the object's record, computing it unless the store has it; raises StageFailed.

    Whoever comes second waits for the lock and then finds the object made. `progress` is called from another thread; what
    it raises or how long it takes does not touch the work.
    """
    key = key_of(stage, config, sources)
    with store.lock(stage.name, key):
        record = store.find(stage.name, key)
        if record is not None:
            return record
        store.drop_broken(stage.name, key)
        with on_the_side(progress) as report, store.turn(stage.name, report) if stage.alone else nullcontext():
            return _compute(store, stage, key, config, sources, report)


def _compute(
    store: Store, stage: Stage, key: str, config: StageConfig, sources: Mapping[str, Source], progress: Progress
) -> Record:
    if key_of(stage, config, sources) != key:  # the wait for the lock and the turn may have been long
        raise StageFailed(
            stage.name, "error", "the code of aug3d or an engine was changed after this run began", "run again", "", ""
        )
    work = store.work_dir(stage.name, key)
    try:
        if work.exists() and not stage.resumable:
            shutil.rmtree(work)
        work.mkdir(parents=True, exist_ok=True)
        inputs = {name: source.path for name, source in sources.items()}
        made_by = recipe(stage, config)
        if stage.grows:
            inputs[layout.EARLIER] = _link_earlier(store.made_by(stage.name, made_by, _MOST_EARLIER), work)
        job = Job(stage=stage.name, config=config.model_dump(mode="json"), inputs=inputs)
        write_synced(work / layout.JOB, job.model_dump_json(indent=1).encode())
        cost = run_isolated(stage, work, progress)
        outcome = Outcome.model_validate_json((work / layout.OUTCOME).read_bytes())
        for left in (layout.OUTCOME, layout.PROGRESS):
            (work / left).unlink(missing_ok=True)
        shutil.rmtree(work / layout.EARLIER, ignore_errors=True)
        fields = {
            **outcome.model_dump(),
            "recipe": made_by,
            "config": job.config,
            "inputs": {name: source.digest for name, source in sources.items()},
            "versions": engine_versions(stage, config),
            "seconds": round(cost.seconds, 3),
            "cpu_seconds": round(cost.cpu_seconds, 2),
            "peak_mib": round(cost.peak_mib, 1),
        }
        return store.commit(work, stage.name, key, fields)
    except StageFailed as failure:
        kept = store.keep_failure(work, stage.name, key, resumable=stage.resumable)
        failure.replay = failure.replay.replace(str(work), str(kept))
        raise
    except OSError as error:
        if not disk_full(error):
            raise
        raise _disk_failure(store, stage, error) from error


def _link_earlier(earlier: list[Path], work: Path) -> Path:
    folder = work / layout.EARLIER
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir()
    for age, files in enumerate(earlier):
        (folder / f"{age:02d}").symlink_to(files)
    return folder


def _disk_failure(store: Store, stage: Stage, error: OSError) -> StageFailed:
    free_mib = shutil.disk_usage(store.root).free / 2**20
    return StageFailed(
        stage.name,
        "disk",
        f"no space left on the disk of {store.root}: {error}",
        f"free some space (now {free_mib:.0f} MiB free) or choose another disk with --home DIR, then run again",
        log_tail="",
        replay="",
    )
