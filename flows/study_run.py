"""Studies as Prefect flows: those of the Prefect UI, and the one in which a study of the command line runs.

A step that is missing is a task of the flow, the same as in a run of the factory. Where the store is shared, workers of other
machines make cells too, each in a run of its own (`share`); the study itself reads what all have made.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import Annotated, Any, Literal, TypeVar
from uuid import UUID

from prefect import Flow, flow
from prefect.client.schemas.objects import State
from prefect.runtime import flow_run
from prefect.states import Completed, Failed
from pydantic import Field

from aug3d_core.bench.machine import describe_machine
from aug3d_core.factory.walk import Make
from aug3d_core.store.store import Store
from aug3d_core.studies.common.cell import Done, Result
from aug3d_core.studies.common.publication import Publication
from aug3d_core.studies.common.write import write_study
from aug3d_core.studies.named import Asked, Prepared
from aug3d_core.studies.paper.page import publication as paper_publication
from aug3d_core.studies.stability.page import publication as stability_publication
from aug3d_core.studies.tradeoff.findings import crashes
from aug3d_core.studies.tradeoff.page import in_words
from aug3d_core.studies.tradeoff.page import publication as tradeoff_publication
from aug3d_core.studies.tradeoff.study import MOST_DB
from flows.settings import home
from flows.shares import SHARE, parameters_of, shared_out
from flows.takeover import cancel_parts
from tasks import artifacts
from tasks.progress import Listener, listening, reporter
from tasks.run_locks import run_lock
from tasks.studies import log_study, missing_through_prefect

FoundT = TypeVar("FoundT")


def as_flow(
    store: Store, name: str, listener: Listener, asked: Asked, prepared: Prepared[FoundT], done: Done[Any]
) -> FoundT:
    """Run a study of the command line within a flow, and over a Dask cluster if there is one; returns what was found."""
    found: list[FoundT] = []  # the flow itself returns nothing: Prefect would walk through every value

    @flow(name="study from the command line", flow_run_name=name)
    def run() -> None:
        with run_lock(store.root), listening(listener), asked.over_cluster(store):
            found.append(prepared.carry_out(missing_through_prefect(store), done, describe_machine()))

    run()
    return found[0]


@flow(name="study", flow_run_name="{study} of {scene}", on_cancellation=[cancel_parts])
def study_scene(
    study: Annotated[Literal["grouping", "augmentation"], Field(description="Which of the paper's tables.")],
    scene: Annotated[str, Field(description="A scene with a finished run.")],
    seeds: Annotated[int, Field(ge=1, le=100, description="Runs of every arm, each with another seed.")] = 3,
    quick: Annotated[bool, Field(description="A few arms and few steps: takes minutes.")] = False,
) -> State:
    """Make and judge a finished scene in several ways, with intervals. Outputs in the store are reused."""
    asked = Asked(name="paper", given={"study": study, "scene": scene, "seeds": seeds, "quick": quick})
    with _working() as (store, make), shared_out(store):
        found = _found(store, make, asked)
        message = _published(store, paper_publication(found))
    if found.failed:
        return Failed(message=f"{found.failed} of {len(found.results)} runs failed; {message}")
    return Completed(message=f"{len(found.results)} runs; {message}")


def tradeoff_name() -> str:
    """Return what a study of speed against accuracy is called in the pages."""
    return f"speed against accuracy of {', '.join(flow_run.parameters['scenes'])}"


@flow(name="tradeoff", flow_run_name=tradeoff_name, on_cancellation=[cancel_parts])
def tradeoff(
    scenes: Annotated[
        list[str], Field(description="demo for the built-in town, scenes of the registry, or with a finished run.")
    ] = ["demo"],
    seeds: Annotated[int, Field(ge=1, le=100, description="Runs of every arm, each with another seed.")] = 3,
    target_db: Annotated[
        float | None,
        Field(ge=0, le=MOST_DB, description="PSNR that is enough [dB]; none: 0.3 dB below the best that is tried."),
    ] = None,
    search: Annotated[
        bool, Field(description="Only search for the cheapest configuration that is enough; do not try everything.")
    ] = False,
    only: Annotated[
        list[str], Field(description="Only panels with words that begin with these, e.g. domes; none: all.")
    ] = [],
    quick: Annotated[
        bool, Field(description="Few settings, one seed, few steps, a smaller town: takes minutes.")
    ] = False,
) -> State:
    """Chart what every setting of the factory costs and gains. Outputs in the store are reused."""
    messages, crashed = [], 0
    with _working() as (store, make), shared_out(store):
        studies = _tradeoffs(scenes, seeds=seeds, target_db=target_db, search=search, only=only, quick=quick)
        for asked in studies:
            asked.prepared(store)  # a scene that is none is told before anything is made
        for asked in studies:
            found = _found(store, make, asked)
            message = _published(store, tradeoff_publication(found, describe_machine()))
            crashed += crashes(found)
            messages.append(f"{found.scene.name}: {in_words(found)} {message}")
    if crashed:
        return Failed(message=f"{crashed} runs ended in a way that no setting should cause; {'; '.join(messages)}")
    return Completed(message="; ".join(messages))


def _tradeoffs(scenes: Sequence[str], **given: Any) -> list[Asked]:
    return [Asked(name="tradeoff", given={"scene": scene, **given}) for scene in dict.fromkeys(scenes)]


@flow(name="stability", flow_run_name="where methods break", on_cancellation=[cancel_parts])
def stability(
    only: Annotated[
        list[str], Field(description="Only perturbations with words that begin with these; none: all.")
    ] = [],
    seeds: Annotated[int, Field(ge=1, le=100, description="Runs of every cell, each with another seed.")] = 3,
    quick: Annotated[
        bool, Field(description="A few perturbations, harmless and ruinous, one seed: takes minutes.")
    ] = False,
) -> State:
    """Find where each method breaks, and whether the factory notices. Outputs in the store are reused."""
    asked = Asked(name="stability", given={"only": only, "seeds": seeds, "quick": quick})
    with _working() as (store, make), shared_out(store):
        found = _found(store, make, asked)
        message = _published(store, stability_publication(store, found))
    if found.silent or found.crashes:
        return Failed(message=f"{len(found.silent)} silent failures and {len(found.crashes)} crashes; {message}")
    return Completed(message=f"{len(found.results)} cells, none silent; {message}")


@flow(name=SHARE, flow_run_name="share of {study}")
def share(study: Annotated[UUID, Field(description="The flow run of the study.")]) -> State:
    """Make cells of a study of another machine: those that nobody is at. The study starts it, and reads what it made."""
    name, given = parameters_of(study, {name: whole for name, (whole, _) in _STUDIES.items()})
    with _working() as (store, make):
        made = [asked.prepared(store).carry_out(make, _done, "").results for asked in _STUDIES[name][1](**given)]
    return Completed(message=f"all {sum(map(len, made))} cells are there")


_STUDIES: dict[str, tuple[Flow[..., Any], Callable[..., list[Asked]]]] = {
    study_scene.name: (study_scene, lambda **given: [Asked(name="paper", given=given)]),
    tradeoff.name: (tradeoff, _tradeoffs),
    stability.name: (stability, lambda **given: [Asked(name="stability", given=given)]),
}


@contextmanager
def _working() -> Iterator[tuple[Store, Make]]:
    """Hold the locks of the flow run and of the store, and show progress in the Prefect UI."""
    store = Store(home())
    with run_lock(store.root), store.using(), listening(artifacts.PrefectProgress()):
        yield store, missing_through_prefect(store)


def _found(store: Store, make: Make, asked: Asked) -> Any:
    """Make what a study asks for, over a Dask cluster if there is one, and show each cell that is done."""
    prepared = asked.prepared(store)
    with asked.over_cluster(store):
        return prepared.carry_out(make, _done, describe_machine())


def _published(store: Store, study: Publication) -> str:
    """Write and log a study; return its folder, and why it was not logged."""
    folder = write_study(store, study)
    why = log_study(store, study, folder)
    artifacts.publish_study(folder, study.question)
    return f"{folder}; {why}" if why else str(folder)


def _done(result: Result[Any], cells: int, total: int) -> None:
    reporter("cells")(cells, total, result.cell.name)
