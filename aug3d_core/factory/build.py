"""Build one object, or find it in the store: lock, isolated run, commit."""

from __future__ import annotations

import shutil
from collections.abc import Callable, Mapping
from contextlib import nullcontext
from dataclasses import dataclass, replace
from pathlib import Path

from aug3d_core.factory.material import Source
from aug3d_core.run.atomic_file import write_synced
from aug3d_core.run.errors import StageFailed
from aug3d_core.run.files import EARLIER, JOB, OUTCOME, PROGRESS
from aug3d_core.run.full_disk import disk_full, disk_of
from aug3d_core.run.process import run_isolated
from aug3d_core.run.progress import on_the_side
from aug3d_core.run.stage import Outcome, Progress, Stage, StageConfig
from aug3d_core.run.stage_main import Job
from aug3d_core.store.keys import engine_versions, object_key, recipe_of
from aug3d_core.store.record import Record
from aug3d_core.store.seal import sealed
from aug3d_core.store.store import Store

_MOST_EARLIER = 8  # outputs of a stage's recipe that it may look at for work to reuse


@dataclass(frozen=True)
class Work:
    """An object to be built. The key and the recipe in it are computed once, here.

    before: the scene's own object of the step before this run, whose work may be reused; it does not change the key.
    """

    stage: Stage
    config: StageConfig
    sources: Mapping[str, Source]
    recipe: str
    key: str
    before: Record | None = None

    @property
    def input_digests(self) -> dict[str, str]:
        """The digest of each input, by name."""
        return {name: source.digest for name, source in self.sources.items()}

    def afresh(self) -> Work:
        """Return the same work with a key of its own, for an answer that has not grown from an earlier one."""
        return work_of(replace(self.stage, grows=False, afresh=True), self.config, self.sources)


@dataclass(frozen=True)
class Built:
    """An object's record, and whether it was in the store already. damage: what was wrong with it there, "" if nothing."""

    record: Record
    cached: bool
    damage: str = ""


def work_of(stage: Stage, config: StageConfig, sources: Mapping[str, Source]) -> Work:
    """Return what is to be built of a stage's inputs, with its key."""
    recipe = recipe_of(stage, config, _code_run(stage, sources))
    digests = {name: source.digest for name, source in sources.items()}
    return Work(stage, config, sources, recipe, object_key(recipe, digests))


def _code_run(stage: Stage, sources: Mapping[str, Source]) -> list[str]:
    return [module for name in stage.runs if name in sources for module in sources[name].modules]


def build(store: Store, work: Work, progress: Progress) -> Built:
    """Return the object, computed unless the store has it whole; raises StageFailed.

    Every file of an object in the store is compared with its digest, the first time in a process: what is damaged is put
    aside and made again.

    A second caller waits for the lock and then finds the object. `progress` is called from another thread: an error or a
    delay in it does not affect the work. Raises DamagedError if an input in the store is not what was written.
    """
    stage = work.stage
    if whole := store.whole(stage.name, work.key):
        return Built(whole, cached=True)
    with store.lock(stage.name, work.key):
        record, damage = store.take(stage.name, work.key)
        if record is not None and not damage:
            return Built(record, cached=True)
        _check_inputs(store, work)
        with on_the_side(progress) as report, store.lease(stage.name, work.key, report) as ours:
            if not ours:
                theirs, _ = store.take(stage.name, work.key)
                assert theirs, "another machine has made it"
                return Built(theirs, cached=True)
            with (
                store.turn(stage.name, report) if stage.alone else nullcontext(),
                store.handing_over(stage.name, work.key, stage.shards, bool(stage.assist)) as others_spent,
            ):
                made = _compute(store, work, report, others_spent)
    return Built(made, cached=False, damage=damage and f"{damage}: {_made_again(record, made)}")


def assist(store: Store, work: Work, progress: Progress) -> bool:
    """Make shards of an object that another machine makes, until all are there; return whether there was anything to do.

    They go to the shared store, where that machine finds them. Raises StageFailed.
    """
    stage = replace(work.stage, entry=work.stage.assist)
    with store.lock(stage.name, work.key):
        if store.find(stage.name, work.key):
            return False
        _check_inputs(store, work)
        folder = store.work_dir(stage.name, work.key)
        with (
            on_the_side(progress) as report,
            store.turn(stage.name, report) if stage.alone else nullcontext(),
            store.helping(stage.name, work.key, stage.shards) as tell_spent,
        ):
            _prepare(store, replace(work, stage=stage), folder)
            tell_spent(run_isolated(stage, folder, report).cpu_seconds)
        shutil.rmtree(folder)
    return True


def _made_again(before: Record | None, now: Record) -> str:
    if before is None:
        return "it was made again"
    if before.digest == now.digest:
        return "it was made again, byte for byte the same"
    return "it was made again with other bytes, and so is what follows from it"


def _check_inputs(store: Store, work: Work) -> None:
    for source in work.sources.values():
        if source.made is not None:
            store.check(source.made, source.reads)


def _compute(store: Store, work: Work, progress: Progress, others_spent: Callable[[], float]) -> Record:
    stage = work.stage
    # The wait for the lock and the turn may have been long
    if recipe_of(stage, work.config, _code_run(stage, work.sources)) != work.recipe:
        raise StageFailed(
            stage.name, "error", "the code of aug3d or an engine changed after this run began", "run again", "", ""
        )
    folder = store.work_dir(stage.name, work.key)
    try:
        job = _prepare(store, work, folder)
        cost = run_isolated(stage, folder, progress)
        outcome = Outcome.model_validate_json((folder / OUTCOME).read_bytes())
        for left in (OUTCOME, PROGRESS):
            (folder / left).unlink(missing_ok=True)
        shutil.rmtree(folder / EARLIER, ignore_errors=True)
        fields = {
            **outcome.model_dump(),
            "recipe": work.recipe,
            "config": job.config,
            "inputs": work.input_digests,
            "modules": work.config.modules,
            "versions": engine_versions(stage, work.config),
            "seconds": round(cost.seconds, 3),
            "cpu_seconds": round(cost.cpu_seconds + others_spent(), 2),
            "peak_mib": round(cost.peak_mib, 1),
        }
        return store.commit(folder, stage.name, work.key, fields)
    except StageFailed as failure:
        kept = store.keep_failure(folder, stage.name, work.key, resumable=stage.resumable)
        failure.replay = failure.replay.replace(str(folder), str(kept))
        raise
    except OSError as error:
        if not disk_full(error):
            raise
        raise _disk_failure(store, stage, error) from error


def _prepare(store: Store, work: Work, folder: Path) -> Job:
    """Write the job into its work folder, which keeps what a killed try of a resumable stage left there."""
    if folder.exists() and not work.stage.resumable:
        shutil.rmtree(folder)
    folder.mkdir(parents=True, exist_ok=True)
    inputs = {name: source.path for name, source in work.sources.items()}
    if work.stage.grows:
        earlier = store.made_by(work.stage.name, work.recipe, _MOST_EARLIER, work.before)
        inputs[EARLIER] = _link_earlier(earlier, folder)
    config = work.config.model_dump(mode="json")
    job = Job(stage=work.stage.name, entry=work.stage.entry, config=config, inputs=inputs)
    write_synced(folder / JOB, sealed(job.model_dump(mode="json")))
    return job


def _link_earlier(earlier: list[Path], work: Path) -> Path:
    folder = work / EARLIER
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir()
    for age, files in enumerate(earlier):
        (folder / f"{age:02d}").symlink_to(files)
    return folder


def _disk_failure(store: Store, stage: Stage, error: OSError) -> StageFailed:
    full, remedy = disk_of(str(error), store.root)
    problem = f"no space left on the disk of {full}: {error}"
    return StageFailed(stage.name, "disk", problem, remedy, log_tail="", replay="")
