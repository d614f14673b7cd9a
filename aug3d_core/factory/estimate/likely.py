"""The settings that a run is likely to have, where they are decided from a scene of which little is known yet."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from aug3d_core.factory.auto.decision import Known
from aug3d_core.factory.auto.settle import settle_by
from aug3d_core.factory.config import SceneConfig, left_open
from aug3d_core.factory.estimate.size import SceneSize
from aug3d_core.factory.material import Material
from aug3d_core.factory.walk import Visit
from aug3d_core.run.stage import Metric
from aug3d_core.store.record import Record
from aug3d_core.store.store import Store

# What most scenes turned out to be: groups of 10 that overlap, for which nothing is rendered, and a good mesh
_USUAL: Mapping[tuple[str, str], Metric] = {
    ("grouping", "k"): 10,
    ("grouping", "support_views"): 9,
    ("surface", "render_psnr"): 28.0,
    ("surface", "covered_share"): 0.9,
    ("dataset", "groups_rendered"): 0,
    ("dataset", "groups_real"): 32,
}
_NOTHING = SceneSize(0, 0.0)
_TRAINED_ON = 0.53  # share of the photographs that a split leaves to train on


@dataclass(frozen=True)
class Likely(Known):
    """What is known of a scene, and where nothing is, what is usual."""

    size: SceneSize = _NOTHING

    def metric(self, stage: str, name: str) -> Metric:
        """Return a figure of a stage, a usual one if it is not made."""
        return super().metric(stage, name) if stage in self.records else _USUAL.get((stage, name))

    @property
    def photos(self) -> int:
        """The number of photographs."""
        return self.size.photos

    @property
    def training_photos(self) -> int:
        """How many photographs are likely worth training on."""
        return max(round(_TRAINED_ON * self.size.photos), 1)

    @property
    def photo_sizes(self) -> Float[np.ndarray, "1 2"]:
        """Width and height that the median photograph is worked on with, px."""
        given = np.array([[self.size.width_px, self.size.height_px]])
        return np.rint(given * min(1.0, self.config.photos.max_px / given.max()))


def likely_settings(
    config: SceneConfig, size: SceneSize, plan: Sequence[Visit], store: Store, material: Material
) -> SceneConfig:
    """Return the settings of a run: those that are decided already, and those that likely will be.

    The names of the latter stay in `auto`: they are not certain.
    """
    decided = {visit.step.stage.name: visit.work.config for visit in plan if visit.work and not visit.step.fold}
    records: dict[str, Record] = {visit.step.name: visit.record for visit in plan if visit.record}
    left = tuple(
        f"{stage.name}.{field}"
        for stage in material.stages()
        if stage.name not in decided
        for field in left_open(config, stage.name)
    )
    found = config.model_copy(update=decided)
    for stage in material.stages():
        if stage.name not in decided:
            known = Likely(found.model_copy(update={"auto": config.auto}), records, store, material, size)
            found = found.model_copy(update={stage.name: settle_by(stage, known).config})
    return found.model_copy(update={"auto": left})
