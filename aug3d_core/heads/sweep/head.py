"""The plane sweep as a head: what training and judging see of it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import torch
from jaxtyping import Bool, Float, Int, UInt8
from torch import Tensor
from torch.nn import functional as F

from aug3d_core.dataset.batches import Group
from aug3d_core.dataset.scene import FINER, RENDERED, Scene
from aug3d_core.dataset.warp import Inputs, Target, lookup, on_device
from aug3d_core.heads.exposure import Exposure, gains
from aug3d_core.heads.head import Head, Start, View, colour_measures, to_8_bit
from aug3d_core.heads.sweep.config import RANDOM, SHIPPED_FEATURES, TOWNS, SweepConfig
from aug3d_core.heads.sweep.disguise import PLAIN, Disguise
from aug3d_core.heads.sweep.network import COARSE, Found, Given, Seen, SweepNetwork
from aug3d_core.heads.sweep.start import first_weights

_SOFT = 1e-2  # of colours in [0, 1]: below it an error counts squared, above it as it is
_SQUARED = 10.0  # weight of squared errors beside them: PSNR is their mean
_EDGES = 0.2  # weight of the error of differences between neighbouring pixels
_HEIGHT_SOFT = 0.05  # the same of heights in the slab
_PLANES = 0.1  # weight of the likelihood of the right planes, beside the error of the mean height
_LEVEL = 0.3  # of the slab: about the ground, at which inputs are compared where no scaffold tells better
_LEAST_ASIDE = 0.005  # 1 - cosine: looks that are closer to the target's are as close
_OFF, _WAVE_PX = 0.01, 16  # of the errors given to exact scaffolds: at most this spread [slabs], one in so many px
_MOST_BENT_PX, _BEND_PX = 2.0, 8  # by which edges of theirs are bent, and one in so many px

Window = tuple[int, int, int, int]  # left, top, width, height, px


class SweepHead(Head):
    """The network with its loss: errors of colours, of their edges, and of heights where the depth is known."""

    config: SweepConfig

    def __init__(self, config: SweepConfig) -> None:
        super().__init__()
        self.config = config
        self.network = SweepNetwork(config)

    def start(self) -> Start:
        """Load the first weights that the settings name."""
        named = self.config.fitting_start
        if named != self.config.start:
            note = (
                f"the shipped weights are of {SHIPPED_FEATURES} features, not {self.config.features}: random ones were taken,"
                " which need training.learning_rate=0.001 and training.steps=1200 or more"
            )
            return Start(metrics={"started_with": RANDOM}, notes=(note,))
        if named != RANDOM:
            self.load_state_dict(first_weights(self, named))
        return Start(metrics={"started_with": named if named in (RANDOM, TOWNS) else Path(named).name})

    @torch.no_grad()
    def finish(self) -> None:
        """Take the mean with the first weights: it keeps what they know of other places (Wortsman et al., CVPR 2022)."""
        if self.config.fitting_start == RANDOM or not self.config.start_share:
            return
        first = first_weights(self, self.config.fitting_start)
        for name, value in self.named_parameters():
            value.lerp_(first[name].to(value), self.config.start_share)

    def loss(
        self, scenes: Sequence[Scene], groups: Sequence[Group], noise: torch.Generator | None
    ) -> tuple[Float[Tensor, ""], dict[str, Float[Tensor, ""]]]:
        """Compare a window of one target of each group. height_error: of both volumes and of the guesses, added."""
        found = [self._loss_of(scenes[group.scene], group, noise) for group in groups]
        names = found[0][1]
        measured = {name: torch.stack([told[name] for _, told in found]).mean() for name in names}
        return torch.stack([loss for loss, _ in found]).mean(), measured

    @torch.inference_mode()
    def predict(self, scene: Scene, target: int, inputs: Int[np.ndarray, " v"]) -> View:
        """Predict a whole view from the target's scaffold, if it has one, and from the inputs alone."""
        view = self.predict_bare(scene, target, inputs)
        if view.started_from != "scaffold":
            return view
        alone = self._see(scene, target, inputs, (0, 0, scene.width_px, scene.height_px), None)
        return replace(view, parts={"inputs_alone": _picture(alone)})

    @torch.inference_mode()
    def predict_bare(self, scene: Scene, target: int, inputs: Int[np.ndarray, " v"]) -> View:
        """Predict a whole view from the target's scaffold, or from the inputs alone where it has none."""
        window = (0, 0, scene.width_px, scene.height_px)
        start = self._scaffold(scene, target, window)
        seen = self._see(scene, target, inputs, window, start)
        colour = _picture(seen)
        if start is None:
            return _view(seen, colour, "inputs")
        row = np.flatnonzero(scene.baseline_view == target)
        if len(row):  # the mesh's colour where no input sees
            bare = ~seen.seen.cpu().numpy() & (scene.baseline_alpha[row[0]] >= 128)
            colour[bare] = scene.baseline_images[row[0]][bare]
        return _view(seen, colour, "scaffold")

    def _loss_of(
        self, scene: Scene, group: Group, noise: torch.Generator | None
    ) -> tuple[Float[Tensor, ""], dict[str, Float[Tensor, ""]]]:
        view = int(group.targets[_drawn(len(group.targets), noise)])
        inputs = _nearest_first(scene, view, group.inputs)
        if noise:  # two to all of them: the nearest, as in the test's groups
            inputs = inputs[: len(inputs) - _drawn(max(len(inputs) - 1, 1), noise)]
        window = self._window(scene, noise)
        left, top, width, height = window
        cut = (view, slice(top, top + height), slice(left, left + width))
        start = self._scaffold(scene, view, window) if noise and _drawn(2, noise) else None
        if start is not None and scene.source[view] == RENDERED:
            start = self._blurred(scene, view, window, start, noise)
        disguise = Disguise.drawn(self.config, len(inputs), noise)
        seen = self._see(scene, view, inputs, window, start, disguise)
        truth = disguise.of_target(self._tensor(scene.images[cut]) / 255).movedim(-1, 0)
        shown = (self._tensor(scene.alpha[cut]) >= 128).float()
        weight = shown / shown.sum().clamp(min=1)
        loss = _error(seen.colour, truth, weight) + _EDGES * _edge_error(seen.colour, truth, shown)
        off = self._height_error(scene, seen, cut, window, shown) + self._guess_error(scene, seen, inputs)
        flat = (one.flatten(-2).T[None] for one in (seen.colour, truth, weight[None]))
        return loss + self.config.depth_weight * off, {**colour_measures(*flat), "height_error": off}

    def _scaffold(self, scene: Scene, view: int, window: Window) -> Float[Tensor, "h w"] | None:
        """Return the depth that a scene's mesh has for a window; None where it has none, or none is asked for."""
        if not self.config.scaffold:
            return None
        left, top, width, height = window
        depth = scene.scaffold[view, top : top + height, left : left + width]
        return self._tensor(depth) if depth.any() else None

    def _blurred(
        self, scene: Scene, view: int, window: Window, depth: Float[Tensor, "h w"], noise: torch.Generator | None
    ) -> Float[Tensor, "h w"]:
        """Return a render's exact depth with the errors of a mesh of photographs: edges that moved, small things that are
        missing, and smooth waves.
        """
        target = Target.of(scene, view, window, self.device)
        heights = _reshaped(target.height_of(depth), depth > 0, noise)
        cells = [max(side // _WAVE_PX, 2) for side in depth.shape]
        waves = (
            torch.randn((1, 1, *cells), generator=noise).to(self.device) * _OFF * torch.rand((), generator=noise).item()
        )
        off = F.interpolate(waves, size=depth.shape, mode="bicubic", align_corners=False)[0, 0]
        return torch.where(depth > 0, target.depth_at(heights + off), depth)

    def _height_error(
        self, scene: Scene, seen: Seen, cut: tuple[int, slice, slice], window: Window, shown: Float[Tensor, "h w"]
    ) -> Float[Tensor, ""]:
        """Return the mean errors [slabs] of both volumes, added, where the target's depth is known; 0 where it is nowhere."""
        depth = self._tensor(scene.depth[cut].astype(np.float32))
        known = ((depth > 0) & (shown > 0)).float()
        truth = Target.of(scene, cut[0], window, self.device).height_of(depth)
        errors = []
        for found in seen.found:
            whole = F.interpolate(found.height[None, None], size=depth.shape, mode="bilinear", align_corners=False)[
                0, 0
            ]
            off = F.smooth_l1_loss(whole, truth, beta=_HEIGHT_SOFT, reduction="none")
            errors.append((off * known).sum() / known.sum().clamp(min=1) + _PLANES * _plane_error(found, truth, known))
        return torch.stack(errors).sum()

    def _guess_error(self, scene: Scene, seen: Seen, inputs: Int[np.ndarray, " v"]) -> Float[Tensor, ""]:
        """Return the mean error of the heights guessed from each input alone, where its depth is known."""
        depth = self._tensor(scene.depth[inputs].astype(np.float32))
        whole = (0, 0, scene.width_px, scene.height_px)
        truth = torch.stack(
            [Target.of(scene, int(v), whole, self.device).height_of(d) for v, d in zip(inputs, depth, strict=True)]
        )
        step = COARSE // 2
        rows, columns = (slice(step, side // COARSE * COARSE, COARSE) for side in depth.shape[1:])
        truth, known = truth[:, rows, columns], (depth > 0).float()[:, rows, columns]
        off = F.smooth_l1_loss(seen.guesses[:, 0], truth, beta=_HEIGHT_SOFT, reduction="none")
        return (off * known).sum() / known.sum().clamp(min=1)

    def _see(
        self,
        scene: Scene,
        target: int,
        views: Int[np.ndarray, " v"],
        window: Window,
        start: Float[Tensor, "h w"] | None,
        disguise: Disguise = PLAIN,
    ) -> Seen:
        rays = Target.of(scene, target, window, self.device)
        cameras = Inputs.of(scene, target, views, self.device)
        scaffolds = None if start is None else self._tensor(scene.scaffold[views])[:, None]
        rgb = disguise.of_inputs(self._tensor(scene.images[views]) / 255)
        alpha = self._tensor(scene.alpha[views])[..., None] / 255
        fine = disguise.of_inputs(self._tensor(scene.fine(views)) / 255, FINER)
        factors = _exposures(rays, cameras, rgb, alpha, start, scaffolds)
        rgb, fine = ((picture * factors).clamp(0, 1) for picture in (rgb, fine))
        even = Exposure.of(rgb[None], alpha[None]).even(rgb[None])[0]
        given = Given(
            torch.cat([rgb, alpha], dim=-1).movedim(-1, 1),
            fine.movedim(-1, 1).contiguous(),
            even.movedim(-1, 1).contiguous(),
            scaffolds,
            start,
        )
        return self.network(rays, cameras, given)

    def _window(self, scene: Scene, noise: torch.Generator | None) -> Window:
        """Draw where to look at a target: a window of whole coarse features."""
        width, height = self.config.crop_px // COARSE * COARSE, self.config.crop_px * 3 // 4 // COARSE * COARSE
        width, height = min(width, scene.width_px), min(height, scene.height_px)
        left, top = (
            _drawn(whole - part + 1, noise) for whole, part in ((scene.width_px, width), (scene.height_px, height))
        )
        return left, top, width, height

    def _tensor(self, array: np.ndarray) -> Tensor:
        return on_device(array, self.device)


def _reshaped(
    heights: Float[Tensor, "h w"], known: Bool[Tensor, "h w"], noise: torch.Generator | None
) -> Float[Tensor, "h w"]:
    """Return heights as a mesh may have them: edges bent by about a pixel, and in one of four without what is small.

    Those that are not known have no say, and come out as anything.
    """
    if _drawn(4, noise) == 0:
        reach = 1 + _drawn(2, noise)
        kernel = (2 * reach + 1, 1, reach)
        low = -F.max_pool2d(torch.where(known, -heights, -torch.inf)[None], *kernel)
        heights = F.max_pool2d(torch.where(known, low, -torch.inf), *kernel)[0]
    by = _MOST_BENT_PX * torch.rand((), generator=noise).item()
    bends = (
        torch.randn((1, 2, *(side // _BEND_PX + 2 for side in heights.shape)), generator=noise).to(heights.device) * by
    )
    bends = F.interpolate(bends, size=heights.shape, mode="bicubic", align_corners=False)[0]
    y, x = (torch.arange(side, device=heights.device) + 0.5 for side in heights.shape)
    xy_px = torch.stack([x + bends[0], y[:, None] + bends[1]], dim=-1)[None, None]
    share = known.float()[None, None]
    found = lookup(torch.cat([torch.where(known, heights, 0.0)[None, None], share], dim=1), xy_px, 1)[0, :, 0]
    return found[0] / found[1].clamp(min=1e-6)


def _exposures(
    target: Target,
    cameras: Inputs,
    rgb: Float[Tensor, "v y x 3"],
    alpha: Float[Tensor, "v y x 1"],
    start: Float[Tensor, "h w"] | None,
    scaffolds: Float[Tensor, "v 1 y x"] | None,
) -> Float[Tensor, "v 1 1 3"]:
    """Return the factors of colours that make the inputs alike where they show the same points: those of the scaffold, or of
    a level that is good enough for a median. Inputs that look most as the target does count most: it was exposed as they were.
    """
    coarse = target.at_stride(COARSE)
    if start is None:
        depth = coarse.depth_at(torch.full_like(coarse.rise, _LEVEL))
    else:
        depth = F.interpolate(start[None, None], size=coarse.rise.shape, mode="nearest")[0, 0]
    xy_px, inside = cameras.project(coarse, depth[None])
    shown = lookup(torch.cat([rgb, alpha], dim=-1).movedim(-1, 1), xy_px, 1)[:, :, 0]
    seen = inside & (shown[:, 3:] > 0.5) & (depth > 0)
    if scaffolds is not None:
        seen = seen & ~cameras.hidden(coarse, depth, scaffolds, xy_px)[:, None]
    factors = gains(shown[:, :3], seen.float())
    points = seen.flatten(1).sum(dim=1)
    aside = ((1 - cameras.cosines(coarse, depth)) * seen[:, 0]).flatten(1).sum(dim=1) / points.clamp(min=1)
    like = points / (aside + _LEAST_ASIDE)
    usual = (factors.log() * (like / like.sum().clamp(min=1e-6))[:, None]).sum(dim=0)
    return (factors / usual.exp())[:, None, None]


def _picture(seen: Seen) -> UInt8[np.ndarray, "h w 3"]:
    return to_8_bit(seen.colour.movedim(0, -1).cpu().numpy())


def _view(seen: Seen, colour: UInt8[np.ndarray, "h w 3"], started_from: str) -> View:
    depth, confidence = (one.cpu().numpy() for one in (seen.depth, seen.confidence))
    return View(colour, depth, confidence, seen.seen.cpu().numpy(), started_from)


def _plane_error(found: Found, truth: Float[Tensor, "h w"], known: Float[Tensor, "h w"]) -> Float[Tensor, ""]:
    """Return how unlikely a volume holds the two heights about the true one: the mean of minus the logarithm of their share.

    Compared at the middle pixel of each feature, where the depth is known and among the heights that were compared.
    """
    stride = round(truth.shape[-1] / found.height.shape[-1])
    truth, known = (one[stride // 2 :: stride, stride // 2 :: stride] for one in (truth, known))
    step = (found.compared[1] - found.compared[0]).clamp(min=1e-6)
    near = (1 - (found.compared - truth).abs() / step).clamp(min=0)
    among = known * (near.sum(dim=0) > 0.5)
    unlikely = -(near * torch.log(found.share + 1e-5)).sum(dim=0)
    return (unlikely * among).sum() / among.sum().clamp(min=1)


def _nearest_first(scene: Scene, view: int, inputs: Int[np.ndarray, " v"]) -> Int[np.ndarray, " v"]:
    eyes = scene.world_from_cam[:, :3, 3]
    return inputs[np.argsort(np.linalg.norm(eyes[inputs] - eyes[view], axis=1), kind="stable")]


def _drawn(count: int, noise: torch.Generator | None) -> int:
    """Draw one of so many; the middle one without noise."""
    return count // 2 if noise is None else int(torch.randint(count, (1,), generator=noise))


def _error(colour: Float[Tensor, "3 h w"], truth: Float[Tensor, "3 h w"], weight: Float[Tensor, "h w"]) -> Tensor:
    off = colour - truth
    return ((torch.sqrt(off**2 + _SOFT**2) + _SQUARED * off**2).mean(dim=0) * weight).sum()


def _edge_error(colour: Float[Tensor, "3 h w"], truth: Float[Tensor, "3 h w"], shown: Float[Tensor, "h w"]) -> Tensor:
    """Return the error of differences between neighbours, where both are shown."""
    parts = []
    for axis in (-1, -2):
        pair = shown.narrow(axis, 1, shown.shape[axis] - 1) * shown.narrow(axis, 0, shown.shape[axis] - 1)
        off = (colour - truth).diff(dim=axis)
        parts.append((off.abs().mean(dim=0) * pair).sum() / pair.sum().clamp(min=1))
    return torch.stack(parts).sum()


HEAD = SweepHead
