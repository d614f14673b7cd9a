"""What is made of a collection: a data set of each scene and town, one training across them, an evaluation of each scene."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

from aug3d_core.collections.entry import CollectionEntry
from aug3d_core.collections.towns import town_works
from aug3d_core.factory.build import Work, work_of
from aug3d_core.factory.material import Material, Source, source_of
from aug3d_core.factory.plan import Step
from aug3d_core.factory.stages import DATASET, EVALUATION, TRAINING
from aug3d_core.factory.walk import Make, Visit, walk
from aug3d_core.run.errors import Aug3dError, InputError, StageFailed, UsageError
from aug3d_core.run.stage import Stage, StageConfig
from aug3d_core.scene_files import SceneEntry
from aug3d_core.store.record import Record
from aug3d_core.store.scenes import records_before
from aug3d_core.store.store import Store
from aug3d_core.store.usage import Object, named

TRAIN, HOLD_OUT, TOWN = "train", "hold out", "town"
Maker = Callable[[str], Make]  # what the steps are of, in words -> how they are made
Materials = Callable[[str, SceneEntry], Material]


def found_here(_scene: str, entry: SceneEntry) -> Material:
    """Return what a scene is made of, which must be on this machine."""
    return entry.material()


@dataclass
class Member:
    """A scene or town of a collection.

    data: its data sets by name, one for each fold. steps: all that the stages made of it. made_up: it has no photographs.
    photos, poses: what the stages `photos` and `sfm` made of a scene. trouble: why it has no data set.
    """

    role: str
    made_up: bool = False
    data: dict[str, Record] = field(default_factory=dict)
    steps: list[Record] = field(default_factory=list)
    photos: Record | None = None
    poses: Record | None = None
    trouble: str = ""
    remedy: str = ""

    @property
    def judged_on(self) -> dict[str, Record]:
        """The data sets with a fair test: what other folds hold out, the first, which is trained on, shows the model."""
        if self.role == TOWN:
            return {}
        return self.data if self.role == HOLD_OUT else dict(list(self.data.items())[:1])


@dataclass
class MadeCollection:
    """What there is so far. evaluations: by the name of the data set that was judged on."""

    members: dict[str, Member] = field(default_factory=dict)
    training: Record | None = None
    evaluations: dict[str, Record] = field(default_factory=dict)
    troubles: dict[str, str] = field(default_factory=dict)  # of evaluations that failed

    @property
    def objects(self) -> list[Object]:
        """All that a version needs: what its data sets come from too, so that the next one need not make it again."""
        steps = [record for member in self.members.values() for record in member.steps]
        return named([*steps, *self.records])

    @property
    def records(self) -> list[Record]:
        """What the training and its judging are made of."""
        data = [record for member in self.members.values() for record in member.data.values()]
        return [*data, *([self.training] if self.training else []), *self.evaluations.values()]

    def trained_on(self, without: str | None = None) -> dict[str, Record]:
        """Return the data sets that a model is trained on: of a scene in folds the first.

        without: those of a model that is to be judged on this scene, which may be trained on the scenes held out otherwise.
        """
        return {
            name: next(iter(member.data.values()))
            for name, member in self.members.items()
            if member.data and (member.role != HOLD_OUT if without is None else name != without)
        }


def make_collection(
    store: Store,
    entry: CollectionEntry,
    scenes: Mapping[str, SceneEntry | Aug3dError],
    maker: Maker,
    say: Callable[[str], None] = lambda what: None,
    material_of: Materials = found_here,
) -> MadeCollection:
    """Make everything that changed. A scene that fails does not stop the others; raises InputError if none is left to train on.

    scenes: what the registry says of each. material_of: what a scene is made of.
    """
    made, config = make_data(store, entry, scenes, maker, say, material_of), entry.config()
    chosen = made.trained_on()
    if not chosen:
        first = next(name for name, member in made.members.items() if member.role != HOLD_OUT)
        raise InputError(
            f"no data set is left to train on; {first}: {made.members[first].trouble}", made.members[first].remedy
        )
    sources = {name: source_of(store, record) for name, record in chosen.items()}
    say("training")
    made.training = _single(TRAINING, config.training, sources, maker("collection"))
    model = source_of(store, made.training)
    for name, member in made.members.items():
        for data, record in member.judged_on.items():
            if not record.metrics.get("groups_test"):
                made.troubles[data] = "its data set has no test"
                continue
            say(f"judging on {data}")
            judged = {"dataset": source_of(store, record), "training": model}
            try:
                made.evaluations[data] = _single(EVALUATION, config.evaluation, judged, maker(name))
            except StageFailed as failure:
                made.troubles[data] = failure.problem
    return made


def make_data(
    store: Store,
    entry: CollectionEntry,
    scenes: Mapping[str, SceneEntry | Aug3dError],
    maker: Maker,
    say: Callable[[str], None] = lambda what: None,
    material_of: Materials = found_here,
) -> MadeCollection:
    """Make the data sets alone."""
    made, config = MadeCollection(), entry.config()
    for name, role in [*((name, TRAIN) for name in entry.train), *((name, HOLD_OUT) for name in entry.hold_out)]:
        say(name)
        made.members[name] = _scene(store, name, role, scenes, maker(name), material_of)
    for name, work in town_works(entry.towns, entry.towns_seed, config.dataset.width_px):
        say(name)
        made.members[name] = _town(name, work, maker(name))
    return made


def _scene(
    store: Store,
    name: str,
    role: str,
    scenes: Mapping[str, SceneEntry | Aug3dError],
    make: Make,
    material_of: Materials,
) -> Member:
    """Make a scene up to its data set, in every fold of a small scene."""
    member = Member(role)
    try:
        entry = scenes.get(name)
        if entry is None:
            known = ", ".join(sorted(scenes)) or "none yet"
            raise UsageError(
                f"scene {name!r} is not in the registry", f"registered scenes: {known}; see aug3d scenes add"
            )
        if isinstance(entry, Aug3dError):
            raise entry
        material = material_of(name, entry)
        member.made_up = material.photos is None
        stages = material.stages()
        before = records_before(store, name)
        for visit in walk(store, stages[: stages.index(DATASET) + 1], entry.config(), material, make, before=before):
            if visit.record is None:
                continue
            member.steps.append(visit.record)
            if visit.step.stage.name == DATASET.name:
                member.data[f"{name}{visit.step.name.removeprefix(DATASET.name)}"] = visit.record
            elif visit.step.name == "photos":
                member.photos = visit.record
            elif visit.step.name == "sfm":
                member.poses = visit.record
    except Aug3dError as error:
        member.trouble, member.remedy = error.problem, error.remedy
    return member


def _town(name: str, work: Work, make: Make) -> Member:
    member = Member(TOWN, made_up=True)
    try:
        member.data[name] = _made(Visit(Step(work.stage), work), make)
    except StageFailed as failure:
        member.trouble, member.remedy = failure.problem, failure.remedy
    return member


def _single(stage: Stage, config: StageConfig, sources: Mapping[str, Source], make: Make) -> Record:
    return _made(Visit(Step(stage), work_of(stage, config, sources)), make)


def _made(visit: Visit, make: Make) -> Record:
    built = make(visit)
    assert built
    return built.record


def step_count(entry: CollectionEntry) -> int:
    """Return how often `make_collection` says something, of scenes without folds."""
    return 2 * len(entry.train) + 2 * len(entry.hold_out) + entry.towns + 1
