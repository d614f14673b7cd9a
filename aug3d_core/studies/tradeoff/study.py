"""The whole study on one scene: every setting, the grid over the factory, `auto`, and the search."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

from aug3d_core.factory.walk import Make
from aug3d_core.run.errors import UsageError
from aug3d_core.store.store import Store
from aug3d_core.studies.common.cell import Cell, Done
from aug3d_core.studies.common.words import picked
from aug3d_core.studies.stability.world import SMALL_TOWN
from aug3d_core.studies.tradeoff.arm import FACTORY, TradeoffArm, TradeoffResult
from aug3d_core.studies.tradeoff.plan import (
    NOT_DRAWN,
    ONE_FOLD,
    auto_arm,
    axes,
    factory_arm,
    grid_arms,
    quick_effort,
    rungs,
    setting_arms,
)
from aug3d_core.studies.tradeoff.point import Point, best, cheapest, on_front, own_test, points
from aug3d_core.studies.tradeoff.run import Objects, make_arm, make_shuffled, objects_there
from aug3d_core.studies.tradeoff.scene import StudiedScene
from aug3d_core.studies.tradeoff.search import Search, Tried, search

ENOUGH_DB = 0.3  # below the best that was tried: what `auto` may lose, and the target where none is given
MOST_DB = 100.0  # views that differ by less differ in no bit that a PNG holds
_SAME_DB = 0.2  # below the scene's own PSNR: the target of a search alone


@dataclass(frozen=True)
class TradeoffFindings:
    """A study of a scene. target_db: the PSNR that is enough. search: None if there was no target to search for.

    in_part: whether only some panels were made.
    """

    scene: StudiedScene
    quick: bool
    seeds: int
    results: Sequence[TradeoffResult]
    target_db: float | None
    search: Search | None
    searched_only: bool
    in_part: bool = False

    @property
    def points(self) -> list[Point]:
        """Every arm, panel after panel."""
        return points(self.results)

    @property
    def test_photos(self) -> int:
        """The number of photographs that the scene's own settings are tested on, in all folds."""
        own = [r for r in self.results if r.arm.panel == FACTORY and r.arm.mark == "preset"]
        return max((len(result.held_out) for result in own), default=0)

    @property
    def factory(self) -> list[Point]:
        """The configurations of the whole factory, without `auto`."""
        return _factory(self.points)

    @property
    def whole(self) -> list[Point]:
        """The configurations of the whole factory, and `auto`."""
        return [point for point in self.points if point.arm.panel == FACTORY]

    @property
    def auto(self) -> Point | None:
        """What the rules of `auto` decided."""
        return next((point for point in self.whole if point.arm.mark == "auto"), None)

    @property
    def best(self) -> Point | None:
        """The most accurate configuration."""
        return best(self.factory)

    @property
    def chosen(self) -> Point | None:
        """The cheapest configuration that reaches the target."""
        return None if self.target_db is None else cheapest(self.factory, self.target_db)


def study_scene(
    store: Store,
    scene: StudiedScene,
    quick: bool,
    seeds: int,
    target_db: float | None,
    search_only: bool,
    make: Make,
    done: Done[TradeoffResult],
    only: Sequence[str] = (),
) -> TradeoffFindings:
    """Study a scene. What a killed study made is in the store, so the same call resumes it.

    only: words of the panels to make, empty for all; raises UsageError if no panel has them, or if no PSNR is `target_db`.
    """
    if target_db is not None and not 0 <= target_db <= MOST_DB:  # nor is NaN
        raise UsageError(
            f"a target of {target_db:g} dB is no PSNR",
            f"give one from 0 to {MOST_DB:g} dB, or none for the best that is tried",
        )
    scene = scene.with_settings(NOT_DRAWN)
    if quick:
        scene = scene.by_default((*ONE_FOLD, *(SMALL_TOWN if scene.town else ())))
        scene = scene.with_settings(quick_effort(scene.config()))
    there = objects_there(store)
    results = make_shuffled(store, scene, _chosen(_first(scene, quick, seeds, search_only), only), there, make, done)
    while not search_only and (again := _again(results, seeds, target_db)):
        results += make_shuffled(store, scene, again, there, make, done)
    target_db = _target(results, target_db, search_only)
    found = TradeoffFindings(scene, quick, seeds, results, target_db, None, search_only, bool(only))
    if found.target_db is None or found.best is None:
        return found
    ended, tried = _search(store, found, there, make, done)
    if search_only:
        known = {result.cell for result in results}
        results = [*results, *(result for result in tried if result.cell not in known)]
    return replace(found, results=results, search=ended)


def _first(scene: StudiedScene, quick: bool, seeds: int, search_only: bool) -> Iterable[Cell[TradeoffArm]]:
    """Yield the cells that are always made: every setting, the grid once, the scene's own configuration, and `auto`."""
    config = scene.config()
    grid = grid_arms(config, quick)
    own = [arm for arm in grid if arm.mark == "preset"]
    if not search_only:
        settings = setting_arms(config, scene.town, quick)
        yield from (Cell(arm, seed) for arm in settings for seed in range(seeds if arm.seeded else 1))
        yield from (Cell(arm, 0) for arm in grid if arm.mark != "preset")
    yield from (Cell(arm, seed) for arm in (*own, auto_arm()) for seed in range(seeds))


def _chosen(cells: Iterable[Cell[TradeoffArm]], only: Sequence[str]) -> list[Cell[TradeoffArm]]:
    """Return the cells of the panels in whose names words begin as given."""
    cells = list(cells)
    wanted = picked("panel", dict.fromkeys(cell.arm.panel for cell in cells), only)
    return [cell for cell in cells if cell.arm.panel in wanted]


def _again(results: Sequence[TradeoffResult], seeds: int, target_db: float | None) -> list[Cell[TradeoffArm]]:
    """Return the cells to repeat: a single seed may be lucky, so the outstanding configurations are made with every seed.

    If the repeats show that one was lucky, others become outstanding. This ends when all of them have every seed.
    """
    factory = _factory(points(results))
    target = _target(results, target_db, False)
    outstanding = [*on_front(factory), best(factory), None if target is None else cheapest(factory, target)]
    arms = dict.fromkeys(point.arm for point in outstanding if point is not None)
    made = {result.cell for result in results}
    return [cell for arm in arms for cell in (Cell(arm, seed) for seed in range(seeds)) if cell not in made]


def _factory(found: Iterable[Point]) -> list[Point]:
    return [point for point in found if point.arm.panel == FACTORY and point.arm.mark != "auto"]


def _target(results: Sequence[TradeoffResult], given_db: float | None, search_only: bool) -> float | None:
    """Return the PSNR that is enough [dB]: as given, else near the best that was tried; None where nothing has a score."""
    if given_db is not None:
        return given_db
    top = best(_factory(points(results)))
    if top is None or top.accuracy is None:
        return None
    return top.accuracy - (_SAME_DB if search_only else ENOUGH_DB)


def _search(
    store: Store, found: TradeoffFindings, there: Objects, make: Make, done: Done[TradeoffResult]
) -> tuple[Search, list[TradeoffResult]]:
    """Search the grid's configurations for the target, with one seed; return also the results that were made for it."""
    assert found.target_db is not None
    config, made = found.scene.config(), []
    usual = own_test(found.results, FACTORY)

    def evaluate(settings: tuple[str, ...], steps: int) -> Tried:
        result = make_arm(store, found.scene, Cell(factory_arm(config, settings, steps), 0), there, make)
        made.append(result)
        done(result, len(made), len(made))
        psnr_db = result.accuracy if result.test == usual else None  # other tests cannot be compared
        return Tried(psnr_db, _objects(result), result.costs.get("training", 0.0))

    return search(axes(config, found.quick), rungs(config, found.quick), found.target_db, evaluate), made


def _objects(result: TradeoffResult) -> Mapping[object, float]:
    return {(record.stage, record.key): record.cpu_seconds or 0.0 for record in result.paid}
