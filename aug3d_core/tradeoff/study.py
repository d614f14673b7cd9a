"""The whole study on one scene: setting by setting, the grid over the factory, `auto`, and the search."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

from aug3d_core.bench.trial import Say
from aug3d_core.stability.world import SMALL_TOWN
from aug3d_core.store.store import Store
from aug3d_core.study.words import picked
from aug3d_core.tradeoff.arm import FACTORY, Arm, Result
from aug3d_core.tradeoff.plan import (
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
from aug3d_core.tradeoff.point import Point, best, cheapest, on_front, points
from aug3d_core.tradeoff.run import Done, Objects, make_all, make_arm, objects_there
from aug3d_core.tradeoff.scene import StudiedScene
from aug3d_core.tradeoff.search import Search, Tried, search

ENOUGH_DB = 0.3  # below the best that was tried: what `auto` may lose, and the target where none is given
_SAME_DB = 0.2  # below the scene's own PSNR: the target of a search alone


@dataclass(frozen=True)
class Studied:
    """A scene, studied. target_db: the PSNR that is enough. search: None where nothing reached it that it could look for."""

    scene: StudiedScene
    quick: bool
    seeds: int
    results: Sequence[Result]
    target_db: float | None
    search: Search | None
    searched_only: bool

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
        """The configurations of the whole factory, `auto` not among them."""
        return [point for point in self.whole if point.arm.mark != "auto"]

    @property
    def whole(self) -> list[Point]:
        """The configurations of the whole factory, and `auto`."""
        return [point for point in self.points if point.arm.panel == FACTORY]

    @property
    def auto(self) -> Point | None:
        """What `needs/` decided."""
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
    say: Say,
    done: Done,
    only: Sequence[str] = (),
) -> Studied:
    """Study a scene; everything made is kept, so that a study that was killed goes on where it was.

    only: words of the panels to make, empty for all; raises UsageError where none has them.
    """
    scene = scene.with_settings(NOT_DRAWN)
    if quick:
        scene = scene.by_default((*ONE_FOLD, *(SMALL_TOWN if scene.town else ())))
        scene = scene.with_settings(quick_effort(scene.config()))
    there = objects_there(store)
    results = make_all(store, scene, _chosen(_first(scene, quick, seeds, search_only), only), there, say, done)
    while not search_only and (again := _again(results, seeds, target_db)):
        results += make_all(store, scene, again, there, say, done)
    found = Studied(scene, quick, seeds, results, _target(results, target_db, search_only), None, search_only)
    if found.target_db is None or found.best is None:
        return found
    looked, tried = _search(store, found, there, say, done)
    if search_only:
        known = {(result.arm, result.seed) for result in results}
        results = [*results, *(result for result in tried if (result.arm, result.seed) not in known)]
    return replace(found, results=results, search=looked)


def _first(scene: StudiedScene, quick: bool, seeds: int, search_only: bool) -> Iterable[tuple[Arm, int]]:
    """Yield what is made whatever comes out: every setting, the grid once, the scene's own, and `auto`."""
    config = scene.config()
    grid = grid_arms(config, quick)
    own = [arm for arm in grid if arm.mark == "preset"]
    if not search_only:
        settings = setting_arms(config, scene.town, quick)
        yield from ((arm, seed) for arm in settings for seed in range(seeds if arm.seeded else 1))
        yield from ((arm, 0) for arm in grid if arm.mark != "preset")
    yield from ((arm, seed) for arm in (*own, auto_arm()) for seed in range(seeds))


def _chosen(cells: Iterable[tuple[Arm, int]], only: Sequence[str]) -> list[tuple[Arm, int]]:
    """Return the cells of the panels in whose names words begin as given."""
    drawn = list(cells)
    wanted = picked("panel", dict.fromkeys(arm.panel for arm, _ in drawn), only)
    return [cell for cell in drawn if cell[0].panel in wanted]


def _again(results: Sequence[Result], seeds: int, target_db: float | None) -> list[tuple[Arm, int]]:
    """Return what is to be repeated: a single seed may be lucky, so what stands out is made with every seed.

    What takes the place of a configuration that was lucky is repeated in turn, until nothing that stands out was made once.
    """
    factory = [p for p in points(results) if p.arm.panel == FACTORY and p.arm.mark != "auto"]
    target = _target(results, target_db, False)
    stand_out = [*on_front(factory), best(factory), None if target is None else cheapest(factory, target)]
    arms = dict.fromkeys(point.arm for point in stand_out if point is not None)
    made = {(result.arm, result.seed) for result in results}
    return [(arm, seed) for arm in arms for seed in range(seeds) if (arm, seed) not in made]


def _target(results: Sequence[Result], given_db: float | None, search_only: bool) -> float | None:
    """Return the PSNR that is enough: as given, else near the best that was tried; None where nothing has a score."""
    if given_db is not None:
        return given_db
    tried = [p for p in points(results) if p.arm.panel == FACTORY and p.arm.mark != "auto"]
    top = best(tried)
    if top is None or top.accuracy is None:
        return None
    return top.accuracy - (_SAME_DB if search_only else ENOUGH_DB)


def _search(store: Store, found: Studied, there: Objects, say: Say, done: Done) -> tuple[Search, list[Result]]:
    """Look for the target among the grid's configurations, with one seed; return also what was made for it."""
    assert found.target_db is not None
    config, made = found.scene.config(), []
    own_test = next(r.test for r in found.results if r.arm.panel == FACTORY and r.arm.mark == "preset")

    def evaluate(settings: tuple[str, ...], steps: int) -> Tried:
        result = make_arm(store, found.scene, factory_arm(config, settings, steps), 0, there, say)
        made.append(result)
        done(result, len(made), len(made))
        psnr_db = result.accuracy if result.test == own_test else None  # of another test it says nothing
        return Tried(psnr_db, _objects(result), result.costs.get("training", 0.0))

    return search(axes(config, found.quick), rungs(config, found.quick), found.target_db, evaluate), made


def _objects(result: Result) -> Mapping[object, float]:
    return {(record.stage, record.key): record.cpu_seconds or 0.0 for record in result.trial.of([*result.costs])}
