"""How each stage grows with a scene and its settings: one law for each, in figures of the reference machine.

A law counts what a stage works on (photographs, pixels, pairs, planes, views, steps) and multiplies it with what one of them
took on the reference machine. That is all that is known before a stage has run; the records of a machine correct it.

The figures are of the town with 15 to 330 photographs of 320 px and with 60 of 640 px, preset `tiny`, in processor seconds on
two cores of an Intel Xeon (no GPU) beside other work, 2026-11-26. An AMD EPYC takes as long for them all, to a tenth
(2026-11-29): it is the machine of the fixed work, and of what `surface` takes. Of PixelNeRF: docs/measured.md. Not measured:
`poses`, mapping with given poses, photographs of more than 1 megapixel.
"""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property

from aug3d_core.dataset.on_disk import USUAL_BYTES
from aug3d_core.dataset.scene import FINER
from aug3d_core.factory.config import SceneConfig
from aug3d_core.factory.estimate.size import SceneSize
from aug3d_core.heads.config import HeadConfig
from aug3d_core.heads.pixelnerf.config import PixelNerfConfig
from aug3d_core.heads.sweep.config import SweepConfig
from aug3d_core.run.memory import total_bytes

MEGA = 1e6
_TEXTURED_MPX = 25.0  # of depth maps, of which a texture is as large as it may be
_TILED_MPX = 38.0  # of depth maps that give as many points as one tile holds: surface/tiles.py
_TILE_MIB = 3150.0  # of a tile's points: surface/draw.py
_TILES_SHARE = 0.5  # of the memory, for the tiles that are drawn at a time: surface/draw.py
_LARGER_MESH = 0.65  # of the seconds that two meshes take on one core each: the larger's share
_BOTH_MESHES = 1.5  # memory of two meshes side by side, over that of the larger
_CACHE_SHARE = 0.5  # of the memory, that fusion takes for maps at the most: depth/fusion.py
_FUSED_MPX = 25.0  # of depth maps that are fused at a time: depth/fusion_tiles.py
_FUSED_MARGIN = 1.4  # what a tile's margin adds to them
_USUAL_SAMPLES = 8  # where their number is chosen, and how many all probes of a view have together
_PROBED = 430
_ALL_RANKED, _RANKED = 129, 24.0  # photographs without GPS: sfm/pairs.py; pairs for each where they are more


@dataclass(frozen=True)
class Figures:
    """Wall time [s], memory at the peak [MiB] and what is left on the disk [MiB]; or ratios of them."""

    seconds: float
    peak_mib: float
    disk_mib: float


@dataclass(frozen=True)
class Work:
    """What a stage takes on the reference machine: processor seconds on one core and on all that there are, MiB, MiB."""

    one_core_s: float = 0.0
    all_cores_s: float = 0.0
    peak_mib: float = 0.0
    disk_mib: float = 0.0

    def on(self, cores: int) -> Figures:
        """Return what it takes on so many idle cores."""
        return Figures(self.one_core_s + self.all_cores_s / cores, self.peak_mib, self.disk_mib)


@dataclass(frozen=True)
class Scene:
    """What stages find to work on, and with. cores: that this process may use. memory_mib: of the machine."""

    config: SceneConfig
    size: SceneSize
    cores: int
    memory_mib: float

    @property
    def photos(self) -> int:
        """The photographs."""
        return max(self.size.photos, 1)

    @property
    def given_mpx(self) -> float:
        """The pixels of a photograph as it was given, in millions."""
        return self.size.photo_px / MEGA

    @cached_property
    def photo_mpx(self) -> float:
        """The pixels that a photograph is worked on with, in millions."""
        aspect = self.size.aspect
        return min(self.given_mpx, self.config.photos.max_px**2 * min(aspect, 1 / aspect) / MEGA)

    @cached_property
    def features(self) -> float:
        """The features of a photograph: about one on 8 x 8 px, or on 15 x 15; some more than is asked for."""
        found = (17_000 if self.config.matching.first_octave < 0 else 4_400) * self.photo_mpx
        return min(found, 1.36 * self.config.matching.max_features)

    @cached_property
    def all_pairs(self) -> float:
        """The pairs of photographs that there are."""
        return self.photos * (self.photos - 1) / 2

    @cached_property
    def pairs(self) -> float:
        """The pairs that are compared: neighbours, each pair counted once."""
        matching = self.config.matching
        few = matching.pairs == "auto" and self.photos <= matching.exhaustive_limit
        if few or matching.pairs == "exhaustive":
            return self.all_pairs
        return min(0.7 * matching.neighbours * self.photos, self.all_pairs)

    @cached_property
    def ranked(self) -> float:
        """The pairs that are compared coarsely: some for each photograph; without GPS all, where photographs are few."""
        if self.pairs == self.all_pairs or self.config.matching.pairs == "gps":
            return 0.0
        if self.config.matching.pairs == "coarse" or not self.size.gps:
            return self.all_pairs if self.photos <= _ALL_RANKED else _RANKED * self.photos
        return min(1.7 * self.config.matching.neighbours * self.photos, self.all_pairs)

    @cached_property
    def mapped(self) -> float:
        """The photographs that have depth maps: all that are not held out."""
        return 0.91 * self.photos

    @cached_property
    def depth_mpx(self) -> float:
        """The pixels of a depth map, in millions: its width is bounded, that of a photograph that stands upright too."""
        return min(self.photo_mpx, self.config.depth.max_px**2 / self.size.aspect / MEGA)

    @cached_property
    def planes(self) -> float:
        """The planes on which a depth map is searched: the longer its longest side, the more."""
        aspect = self.size.aspect
        longest_px = math.sqrt(self.depth_mpx * MEGA * max(aspect, 1 / aspect))
        return 38 * (longest_px / 512) * (2 / self.config.depth.plane_step_px)

    @cached_property
    def k(self) -> int:
        """The photographs in a group."""
        return 10 if self.config.grouping.k == "auto" else self.config.grouping.k

    @cached_property
    def virtual_views(self) -> float:
        """The views that are rendered: of the domes that are asked for some find no place, most over little ground."""
        sampling = self.config.sampling
        return min(0.78 * sampling.domes * (sampling.views_per_dome or self.k), 3.1 * self.photos)

    @cached_property
    def view_mpx(self) -> float:
        """The pixels of a packed view, in millions."""
        return self.config.dataset.width_px * self.config.dataset.height_px / MEGA

    @cached_property
    def fine_mpx(self) -> float:
        """The pixels of all fine images, in millions: photographs have them, rendered views have none."""
        return self.photos * FINER**2 * self.view_mpx

    @cached_property
    def targets(self) -> float:
        """The photographs that are predicted in a fold's test."""
        return max(0.085 * self.photos, 2.0)


Law = Callable[[Scene], Work]


def _town(scene: Scene) -> Work:
    pixels, area_m2 = scene.photos * scene.given_mpx, scene.config.town.length_m * scene.config.town.width_m
    return Work(
        one_core_s=4,
        all_cores_s=0.36 * scene.photos + 1.24 * pixels * scene.config.town.samples,
        peak_mib=430 + 0.0145 * area_m2 + 250 * scene.given_mpx,
        disk_mib=4 + 0.0003 * area_m2 + 0.5 * pixels,
    )


def _photos(scene: Scene) -> Work:
    given, kept = scene.photos * scene.given_mpx, scene.photos * scene.photo_mpx
    return Work(
        one_core_s=0.25,
        all_cores_s=0.006 * scene.photos + 0.05 * given + 0.11 * kept,
        peak_mib=90 + 40 * scene.cores * scene.given_mpx,
        disk_mib=1.95 * kept,
    )


def _poses(scene: Scene) -> Work:
    return Work(one_core_s=0.5 + 0.002 * scene.photos, peak_mib=120, disk_mib=0.01 * scene.photos)


def _matching(scene: Scene) -> Work:
    searched = scene.photo_mpx * (1.0 if scene.config.matching.first_octave < 0 else 0.25)
    thousands = scene.features / 1000
    return Work(
        one_core_s=0.5 + 0.00045 * scene.ranked,
        all_cores_s=2.35 * scene.photos * searched**1.17 + scene.pairs * (0.0134 + 0.0025 * thousands**2),
        peak_mib=310 + 450 * scene.cores * searched + 0.33 * scene.photos * thousands,
        disk_mib=0.16 * scene.photos * thousands,
    )


def _sfm(scene: Scene) -> Work:
    thousands = scene.features / 1000
    return Work(
        one_core_s=0.8 + 0.034 * scene.photos**1.3 * thousands**0.92,
        peak_mib=150 + 0.72 * scene.photos * thousands,
        disk_mib=scene.photos * (1.95 * scene.photo_mpx + 0.045 * thousands),
    )


def _small(seconds: float, a_photo: float, peak_mib: float, disk_mib: float) -> Law:
    """Return the law of a stage that takes seconds: so much, and a little for each photograph."""

    def law(scene: Scene) -> Work:
        return Work(
            one_core_s=seconds + a_photo * scene.photos,
            peak_mib=peak_mib + 0.1 * scene.photos,
            disk_mib=disk_mib * (0.8 + scene.photos / 300),
        )

    return law


def _depth(scene: Scene) -> Work:
    each = 0.4 + 0.14 * scene.depth_mpx * scene.planes * scene.config.depth.sources / 6
    pixels = scene.mapped * scene.depth_mpx
    at_once = pixels if pixels <= _FUSED_MPX else min(pixels, _FUSED_MARGIN * _FUSED_MPX)
    return Work(
        one_core_s=1.0 * pixels,
        all_cores_s=scene.mapped * each,
        peak_mib=165 + min(38 * at_once, _CACHE_SHARE * scene.memory_mib) + 7 * at_once + scene.mapped,
        disk_mib=20 * pixels,
    )


def _surface(scene: Scene) -> Work:
    pixels = scene.mapped * scene.depth_mpx
    textured = (
        min(pixels, _TEXTURED_MPX * scene.config.surface.texel_budget / 2**24) / scene.config.surface.texel_gsd**2
    )
    tiled = min(80 * pixels, scene.cores * _TILE_MIB, max(_TILES_SHARE * scene.memory_mib, _TILE_MIB))
    drawn = 40 * pixels if pixels <= _TILED_MPX else tiled
    both = scene.cores > 1 and 2 * min(drawn, _TILE_MIB) <= _TILES_SHARE * scene.memory_mib  # meshes side by side
    return Work(
        one_core_s=(11 + 3.6 * pixels + 1.0 * textured) * (_LARGER_MESH if both else 1.0),
        all_cores_s=2.9 * pixels + 1.0 * textured,
        peak_mib=(440 + 17 * textured) * (_BOTH_MESHES if both else 1.0)
        + drawn * (_BOTH_MESHES if both and pixels <= _TILED_MPX else 1.0),
        disk_mib=3 + 0.4 * pixels + 2.0 * textured,
    )


def _sampling(scene: Scene) -> Work:
    return Work(one_core_s=3 + 0.3 * scene.config.sampling.domes, peak_mib=300 + 0.2 * scene.photos, disk_mib=0.7)


def _rendering(scene: Scene) -> Work:
    sampling, asked = scene.config.sampling, scene.config.rendering.samples
    view_mpx = sampling.width_px * sampling.height_px / MEGA
    mpx = scene.virtual_views * view_mpx
    if not mpx:
        return Work(one_core_s=0.5, peak_mib=100, disk_mib=0.1)
    probed = _PROBED if asked == "auto" else 0
    samples = _USUAL_SAMPLES if asked == "auto" else asked
    return Work(
        one_core_s=3,
        all_cores_s=1.0 * (mpx * samples + view_mpx * probed),
        peak_mib=300 + 140 * min(scene.cores, 4),
        disk_mib=6.7 * mpx,
    )


def _dataset(scene: Scene) -> Work:
    views = scene.photos + scene.virtual_views
    mpx = views * scene.view_mpx
    return Work(
        one_core_s=0.4 + 0.55 * mpx + 0.14 * scene.fine_mpx + 0.09 * scene.photos * scene.photo_mpx,
        peak_mib=355
        + 0.4 * scene.photos
        + 40 * scene.view_mpx
        + 3 * min(scene.fine_mpx, scene.config.dataset.shard_views * FINER**2 * scene.view_mpx),
        disk_mib=5.2 * mpx + 2.5 * scene.fine_mpx,
    )


def _training(scene: Scene) -> Work:
    training = scene.config.training
    group = _GROUPS_OF_HEADS.get(training.head.name, _unknown_group)(scene, training.head)
    groups = training.groups_per_step * training.steps
    return Work(
        one_core_s=15 + group.one_core_s * groups,
        all_cores_s=group.all_cores_s * groups,
        peak_mib=610 + group.peak_mib * training.groups_per_step + min(3 * scene.fine_mpx, _HELD_MIB),
        disk_mib=1,
    )


def _sweep_group(scene: Scene, head: HeadConfig) -> Work:
    """Return what training takes for a group of photographs, once."""
    assert isinstance(head, SweepConfig)
    crop_mpx = min(0.75 * head.crop_px**2 / MEGA, scene.view_mpx)
    inputs = (scene.config.training.input_views + 1) / 6
    volume = crop_mpx * (head.planes + head.fine_planes) * head.features / 16 * inputs
    return Work(one_core_s=0.38 * volume, all_cores_s=0.38 * volume, peak_mib=450 * volume)


def _pixelnerf_group(scene: Scene, head: HeadConfig) -> Work:
    assert isinstance(head, PixelNerfConfig)
    samples = head.coarse_samples + head.fine_samples + head.depth_samples
    queries = head.rays_per_group * samples * scene.config.training.input_views
    width = head.hidden / 64
    return Work(
        all_cores_s=queries / 127_000 * width**1.7, peak_mib=queries / 330 * width**1.25
    )  # of `aug3d bench nerf`


def _unknown_group(scene: Scene, _: HeadConfig) -> Work:
    """Return what a group takes with a head that nobody measured: as much as the usual one."""
    return _sweep_group(scene, SweepConfig())


_GROUPS_OF_HEADS: Mapping[str, Callable[[Scene, HeadConfig], Work]] = {
    "sweep": _sweep_group,
    "pixelnerf": _pixelnerf_group,
}


_HELD_MIB = USUAL_BYTES / 2**20


def _evaluation(scene: Scene) -> Work:
    evaluation = scene.config.evaluation
    views = 2 * scene.targets + evaluation.flythrough_frames
    return Work(
        one_core_s=4 + 1.2 * scene.targets,
        all_cores_s=10 * views * scene.view_mpx * evaluation.input_views / 3 * 1.6,
        peak_mib=390
        + (4500 + 2000 * evaluation.input_views / 3) * scene.view_mpx
        + min(8 * (scene.photos + scene.virtual_views) * scene.view_mpx + 3 * scene.fine_mpx, _HELD_MIB),
        disk_mib=1.5 + 200 * scene.view_mpx,
    )


LAWS: Mapping[str, Law] = {
    "town": _town,
    "photos": _photos,
    "poses": _poses,
    "matching": _matching,
    "sfm": _sfm,
    "truth": _small(0.25, 0.004, 115, 0.01),
    "similarity": _small(0.25, 0.003, 80, 0.04),
    "grouping": _small(0.25, 0.013, 90, 0.09),
    "overlap": _small(1.4, 0.04, 320, 1.6),
    "depth": _depth,
    "surface": _surface,
    "mesh_truth": _small(1.9, 0.075, 335, 1.1),
    "sampling": _sampling,
    "rendering": _rendering,
    "dataset": _dataset,
    "training": _training,
    "evaluation": _evaluation,
}


def scene_here(config: SceneConfig, size: SceneSize, cores: int | None = None) -> Scene:
    """Return what stages find on this machine. cores: that they may use, None for those of this process."""
    return Scene(config, size, cores or len(os.sched_getaffinity(0)), total_bytes() / 2**20)


def law_of(stage: str, scene: Scene) -> Figures:
    """Return what a stage takes on the reference machine, with as many cores."""
    return LAWS[stage](scene).on(scene.cores)
