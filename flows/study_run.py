"""A study as a Prefect flow, for those who start it in the Prefect UI."""

from __future__ import annotations

from typing import Annotated, Literal

from prefect import flow
from prefect.client.schemas.objects import State
from prefect.states import Completed, Failed
from pydantic import Field

from aug3d_core.bench.machine import describe_machine
from aug3d_core.store.store import Store
from aug3d_core.study.augmentation import augmentation_study
from aug3d_core.study.cell import Result
from aug3d_core.study.effort import repeats, study_effort
from aug3d_core.study.findings import findings
from aug3d_core.study.grouping import grouping_study
from aug3d_core.study.run import run_study
from aug3d_core.study.scene import open_scene
from aug3d_core.study.write import write_study
from aug3d_core.tradeoff.arm import Result as Tried
from aug3d_core.tradeoff.findings import crashes
from aug3d_core.tradeoff.page import in_words
from aug3d_core.tradeoff.scene import open_scene as open_studied
from aug3d_core.tradeoff.study import study_scene as study_tradeoff
from aug3d_core.tradeoff.write import write_study as write_tradeoff
from flows.settings import home
from tasks import artifacts
from tasks.alive import alive
from tasks.progress import listening, reporter
from tasks.studies import log_study, log_tradeoff

_STUDIES = {"grouping": grouping_study, "augmentation": augmentation_study}


@flow(name="study", flow_run_name="{study} of {scene}")
def study_scene(
    study: Annotated[Literal["grouping", "augmentation"], Field(description="Which of the paper's tables.")],
    scene: Annotated[str, Field(description="A scene with a finished run.")],
    seeds: Annotated[int, Field(ge=1, le=100, description="Runs of every arm, each with a seed of its own.")] = 3,
    quick: Annotated[bool, Field(description="A few arms and few steps: minutes, for a look.")] = False,
) -> State:
    """Make and judge a finished scene in several ways, with intervals; what was made before is found again."""
    store = Store(home())
    with alive(store.root), store.using():
        arms = _STUDIES[study](quick)
        opened = study_effort(open_scene(store, scene, None), quick, ())
        with listening(artifacts.PrefectProgress()):
            runs = repeats(seeds, quick)
            results = run_study(store, arms, opened, runs, _say, _done)
        found = findings(arms, opened, runs, results, describe_machine())
        folder = write_study(store, found)
        why = log_study(store, found, folder)
        artifacts.publish_study(folder, arms.question)
    told = f"{folder}; {why}" if why else str(folder)
    if found.failed:
        return Failed(message=f"{found.failed} of {len(found.results)} runs failed; {told}")
    return Completed(message=f"{len(found.results)} runs; {told}")


@flow(name="tradeoff", flow_run_name="speed against accuracy of {scenes}")
def tradeoff(
    scenes: Annotated[
        list[str], Field(description="demo for the built-in town, scenes of the registry, or with a finished run.")
    ] = ["demo"],
    seeds: Annotated[int, Field(ge=1, le=100, description="Runs of every arm, each with a seed of its own.")] = 3,
    target_db: Annotated[
        float | None, Field(description="PSNR that is enough (dB); none: 0.3 dB below the best that is tried.")
    ] = None,
    search: Annotated[
        bool, Field(description="Do not try everything: only look for the cheapest that is enough.")
    ] = False,
    only: Annotated[list[str], Field(description="Only panels with words that begin so, e.g. domes; none: all.")] = [],
    quick: Annotated[bool, Field(description="Few settings, one seed, few steps, a smaller town: minutes.")] = False,
) -> State:
    """Chart what every setting of the factory costs and gains; what was made before is found again."""
    store, machine, told, crashed = Store(home()), describe_machine(), [], 0
    with alive(store.root), store.using():
        for scene in [open_studied(store, name, None) for name in dict.fromkeys(scenes)]:
            with listening(artifacts.PrefectProgress()):
                runs = 1 if quick else seeds
                found = study_tradeoff(store, scene, quick, runs, target_db, search, _say, _tried, only)
            folder = write_tradeoff(store, found, machine)
            artifacts.publish_study(folder, "What does accuracy cost?")
            crashed += crashes(found)
            told += [f"{scene.name}: {in_words(found)} {folder}", log_tradeoff(store, found, folder)]
    if crashed:
        return Failed(message=f"{crashed} runs ended in a way that no setting should bring about; {'; '.join(told)}")
    return Completed(message="; ".join(filter(None, told)))


def _say(stage: str, done: int, total: int, what: str) -> None:
    reporter(stage)(done, total, what)


def _done(result: Result, cells: int, total: int) -> None:
    reporter("cells")(cells, total, result.cell.name)


def _tried(result: Tried, cells: int, total: int) -> None:
    reporter("cells")(cells, total, result.name)
