"""What one training step sees: groups, some of their members as inputs, the others as targets (all in numpy).

A target is a whole image. A head that looks at some pixels only says how many, and finds them drawn in each group.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int

from aug3d_core.dataset.scene import LEAST_SHOWN, Scene
from aug3d_core.run.errors import InputError


@dataclass(frozen=True)
class Wanted:
    """What a step is to see.

    input_views: of each group at most; the smallest group keeps a target. pixels: of each group's targets; None for whole
    images. rendered_share: of the groups.
    """

    groups: int
    input_views: int
    rendered_share: float
    pixels: int | None


@dataclass(frozen=True)
class Group:
    """A group of views of one scene, as rows of it.

    scene: its place in the list of scenes. pixels: view, x, y of the pixels that were drawn from the targets.
    """

    scene: int
    inputs: Int[np.ndarray, " v"]
    targets: Int[np.ndarray, " t"]
    pixels: Int[np.ndarray, "p 3"] | None = None


def check_groups(scenes: Sequence[Scene], wanted: Wanted) -> None:
    """Raise InputError unless every group set to be drawn from can give inputs and at least one target."""
    for scene in scenes:
        sets = _sets(scene, wanted)
        if not sets:
            raise InputError("the data set has no training group", "give the scene more photographs that overlap")
        for name in sets:
            if scene.groups[name].shape[1] < 2:
                raise InputError(f"groups/{name} has groups of one view", "group more views together (grouping.k)")


def given_views(scene: Scene, wanted: Wanted) -> int:
    """Return how many inputs every group of a scene is given: as many as wanted, or all but one of the smallest group."""
    return min(wanted.input_views, min(scene.groups[name].shape[1] for name in _sets(scene, wanted)) - 1)


def draw(scenes: Sequence[Scene], wanted: Wanted, rng: np.random.Generator) -> tuple[Group, ...]:
    """Draw the groups of a training step; each scene is as likely as any other."""
    drawn = [_draw_group(scenes, wanted, rng) for _ in range(wanted.groups)]
    if wanted.pixels is None:
        return tuple(Group(number, inputs, targets) for number, inputs, targets, _ in drawn)
    widths = [scenes[number].width_px for number, *_ in drawn]
    heights = [scenes[number].height_px for number, *_ in drawn]
    columns = [rng.integers(width, size=wanted.pixels) for width in widths]
    rows = [rng.integers(height, size=wanted.pixels) for height in heights]
    return tuple(
        Group(number, inputs, targets, np.stack([views, x, y], axis=1))
        for (number, inputs, targets, views), x, y in zip(drawn, columns, rows, strict=True)
    )


def pixel_colours(
    scene: Scene, pixels: Int[np.ndarray, "p 3"]
) -> tuple[Float[np.ndarray, "p 3"], Float[np.ndarray, " p"]]:
    """Return the colours in [0, 1] of pixels (view, x, y), and a weight of each: 0 where a render shows nothing."""
    view, x, y = pixels.T
    return scene.images[view, y, x] / 255.0, (scene.alpha[view, y, x] >= LEAST_SHOWN).astype(float)


def _draw_group(
    scenes: Sequence[Scene], wanted: Wanted, rng: np.random.Generator
) -> tuple[int, np.ndarray, np.ndarray, np.ndarray]:
    """Return the scene, inputs, targets, and the target of each pixel (none for whole images)."""
    number = int(rng.integers(len(scenes)))
    scene = scenes[number]
    sets = _sets(scene, wanted)
    shares = [wanted.rendered_share if name == "rendered" else 1 - wanted.rendered_share for name in sets]
    groups = scene.groups[sets[rng.choice(len(sets), p=np.array(shares if len(sets) > 1 else [1.0]))]]
    order = rng.permutation(groups[rng.integers(len(groups))])
    given = given_views(scene, wanted)
    inputs, targets = order[:given], order[given:]
    return number, inputs, targets, rng.choice(targets, wanted.pixels or 0)


def _sets(scene: Scene, wanted: Wanted) -> list[str]:
    """Return the group sets to draw from: those that exist and have a share."""
    shares = [("real", 1 - wanted.rendered_share), ("rendered", wanted.rendered_share)]
    found = [name for name, share in shares if share > 0 and len(scene.groups[name])]
    return found or [name for name, _ in shares if len(scene.groups[name])]
