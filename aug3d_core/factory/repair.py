"""Make damaged objects again, each exactly as its job says it was made."""

from __future__ import annotations

from pathlib import Path

from pydantic import ValidationError

from aug3d_core.factory.build import Built, Work, build, work_of
from aug3d_core.factory.material import Source, given_photos, given_poses, source_of, town_photos
from aug3d_core.factory.stages import STAGES, TOWN
from aug3d_core.run.errors import Aug3dError, StoreError
from aug3d_core.run.files import EARLIER, FILES, JOB
from aug3d_core.run.stage import Progress, Stage
from aug3d_core.run.stage_main import Job
from aug3d_core.store.record import Record, read_job
from aug3d_core.store.store import Store
from aug3d_core.store.usage import Object
from aug3d_core.town.files import TOWN_PHOTOS


def repair(store: Store, item: Object, progress: Progress) -> Built:
    """Put a damaged object aside and make it again, what it is made of first.

    Raises StoreError where it cannot be made as it was: its job is damaged too, or the code, an engine or the photographs are
    others now. A run of the scene makes what takes its place then.
    """
    stage_name, key = item
    job = _job(store, item)
    try:
        work = _work(store, job, progress)
    except Aug3dError:
        store.take(stage_name, key)
        raise
    if work.key != key:
        store.take(stage_name, key)
        raise StoreError(
            f"{stage_name} {key} cannot be made as it was: the code of aug3d, an engine or what it reads is another now",
            "it is put aside; run the scene again",
        )
    return build(store, work, progress)


def _job(store: Store, item: Object) -> Job:
    try:
        return Job.model_validate(read_job(store.object_dir(*item) / JOB))
    except (StoreError, ValueError) as error:
        store.take(*item)
        raise StoreError(
            f"what {' '.join(item)} was made of is not known: {JOB} is missing or damaged",
            "it is put aside; run the scene again",
        ) from error


def _work(store: Store, job: Job, progress: Progress) -> Work:
    stage = STAGES.get(job.stage)
    if stage is None or stage.entry != job.entry:
        raise StoreError(f"stage {job.stage} is not one that a run of a scene has", "it is put aside; run it again")
    try:
        config = stage.config.model_validate(job.config)
    except ValidationError as error:
        raise StoreError(
            f"{job.stage} cannot be made as it was: it was made with settings of another version of aug3d",
            "it is put aside; run the scene again",
        ) from error
    sources = {
        name: _source(store, stage, name, path, progress) for name, path in job.inputs.items() if name != EARLIER
    }
    return work_of(stage, config, sources)


def _source(store: Store, stage: Stage, name: str, path: Path, progress: Progress) -> Source:
    """Return an input, repaired where it is damaged."""
    if name == "folder":
        of_town = path.parts[-2:] == (FILES, TOWN_PHOTOS) and path.parts[-4] == TOWN.name  # whichever machine's it was
        return town_photos(store, _whole(store, path.parent, progress)) if of_town else given_photos(path)
    if name == "given":
        return given_poses(path)
    return source_of(store, _whole(store, path, progress), stage.reads.get(name, ()))


def _whole(store: Store, files: Path, progress: Progress) -> Record:
    """Return the object that has this folder of files, made again if it is damaged."""
    key, made_by = files.parent.name, files.parent.parent.name
    record = store.record(made_by, key)
    if isinstance(record, Record) and not store.faults(record):
        return record
    return repair(store, (made_by, key), progress).record
