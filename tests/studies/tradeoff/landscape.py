"""A factory made up of a formula: settings that gain little and cost much, and others the other way round."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np

from aug3d_core.studies.tradeoff.search import Tried

AXES: Mapping[str, Sequence[str]] = {
    "photos.max_px": ("320", "640"),
    "depth.max_px": ("256", "512"),
    "training.head.planes": ("16", "32"),
    "training.head.features": ("8", "16"),
}
RUNGS = (133, 400, 1200)
_UPSTREAM_S = {"320": {"256": 150.0, "512": 260.0}, "640": {"256": 230.0, "512": 350.0}}


class Landscape:
    """PSNR and cost of every configuration; what seeds would do to PSNR is drawn once, from `seed`."""

    def __init__(self, seed: int, noise_db: float) -> None:
        rng = np.random.default_rng(seed)
        self.gains = {name: rng.uniform(-0.1, 0.8) for name in AXES}
        self.by_training = rng.uniform(0.2, 1.2)
        self.noise = rng.normal(0, noise_db, 1000)
        self.asked = 0

    def __call__(self, settings: tuple[str, ...], steps: int) -> Tried:
        self.asked += 1
        values = dict(one.split("=") for one in settings)
        gained = sum(self.gains[name] for name, value in values.items() if value == AXES[name][-1])
        place = int(sum((value == AXES[name][-1]) * 2**i for i, (name, value) in enumerate(values.items())))
        psnr = 21 + gained + self.by_training * math.log2(steps / 133) + self.noise[place * 3 + RUNGS.index(steps)]
        upstream = (values["photos.max_px"], values["depth.max_px"])
        training = 350 * steps / 1200 * (int(values["training.head.planes"]) / 32) ** 0.8
        training *= (12 + int(values["training.head.features"])) / 28
        costs = {("up", *upstream): _UPSTREAM_S[upstream[0]][upstream[1]], (settings, steps): training + 8}
        return Tried(psnr, costs, training)
