"""What is handed over of packed scenes: sequences of views, at the size that is wanted."""

from __future__ import annotations

import io
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
from jaxtyping import Float, Int, UInt8
from PIL import Image

from aug3d_core.dataset.images import Fit, fit
from aug3d_core.dataset.scene import SPLITS, Scene
from aug3d_core.photos.files import image_name

TRAIN, TEST = "train", "test"
IMAGES, DEPTH, MASKS = "images", "depth", "masks"
Size = tuple[int, int]  # width, height [px]


@dataclass(frozen=True)
class Taken:
    """Views of a scene that belong together. context, target: places in `rows`, of a test alone. size: None as packed."""

    key: str
    part: str
    scene: Scene
    rows: Int[np.ndarray, " v"]
    context: tuple[int, ...] = ()
    target: tuple[int, ...] = ()
    size: Size | None = None

    @cached_property
    def fit(self) -> Fit:
        """How packed views are brought to the size that is wanted."""
        packed = self.scene.width_px, self.scene.height_px
        return fit(*packed, *(self.size or packed))

    def intrinsics(self, view: int) -> Float[np.ndarray, " 4"]:
        """Return (fx, fy, cx, cy) of a view [px]."""
        return self.fit.intrinsics(self.scene.intrinsics[view])

    def png(self, view: int) -> bytes:
        """Return a view as a file."""
        colour, _, _ = self._shown(view)
        file = io.BytesIO()
        Image.fromarray(colour).save(file, format="PNG")
        return file.getvalue()

    def depth(self, view: int) -> Float[np.ndarray, "h w"]:
        """Return the depth along z of a view [world units]; 0 where none is known."""
        return self.fit.nearest(np.asarray(self.scene.depth[view], np.float32))

    def mask(self, view: int) -> UInt8[np.ndarray, "h w"]:
        """Return 255 where a view shows something, else 0."""
        return np.where(self._shown(view)[1] >= 128, 255, 0).astype(np.uint8)

    def write_images(self, folder: Path) -> list[str]:
        """Write all views; return their paths, relative to the folder of the sequence."""
        (folder / IMAGES).mkdir(parents=True)
        names = [f"{IMAGES}/{image_name(number)}" for number in range(len(self.rows))]
        for name, view in zip(names, self.rows, strict=True):
            (folder / name).write_bytes(self.png(int(view)))
        return names

    def _shown(self, view: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        depth = np.asarray(self.scene.depth[view], np.float32)
        return self.fit.covered(self.scene.images[view], self.scene.alpha[view], depth)


def sequences(name: str, scene: Scene, trained: bool, size: Size | None) -> Iterator[Taken]:
    """Yield the sequences of a scene; of one that is held out, its test alone."""
    if trained:
        usable = scene.splits == SPLITS.index("train")
        flight = np.flatnonzero(usable & (scene.dome_id < 0))
        if len(flight):
            yield Taken(name, TRAIN, scene, flight, size=size)
        for dome in np.unique(scene.dome_id[scene.dome_id >= 0]):
            yield Taken(f"{name}-dome-{dome:05d}", TRAIN, scene, np.flatnonzero(scene.dome_id == dome), size=size)
    for number, members in enumerate(scene.groups["test"]):
        rows = np.sort(members)
        target = int(np.flatnonzero(rows == members[0])[0])
        context = tuple(place for place in range(len(rows)) if place != target)
        yield Taken(f"{name}-test-{number:05d}", TEST, scene, rows, context, (target,), size)
