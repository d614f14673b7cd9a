"""Features of the inputs -> a coarse volume over the slab -> a fine one about what it found -> blended colours.

The parts, with their models: masked statistics over any number of views (IBRNet), a cascade of two volumes and colour as a
blend of the inputs' pixels (ENeRF).
"""

from __future__ import annotations

import math
from typing import NamedTuple

import torch
from jaxtyping import Bool, Float, Int
from torch import Tensor, nn
from torch.nn import functional as F

from aug3d_core.dataset.scene import FINER
from aug3d_core.dataset.warp import Inputs, Target, fine_colours, lookup
from aug3d_core.heads.sweep.config import SweepConfig

COARSE, FINE = 4, 2  # px for each feature
_NARROW = 8  # channels of the fine features
_INSIDE = 16  # channels inside the volumes
_LEAST_SPREAD, _MOST_SPREAD = 0.5, 0.25  # of the fine planes: of a coarse step, and of the slab
_BEYOND = 1.5  # spreads that the fine planes reach to either side
_SLOPE = 0.1  # of rectifiers below 0
_LEAST_ALPHA = 0.5  # of an input, from which it shows something
_ASIDE = 0.01  # 1 - cosine, 8 degrees: inputs that look at a point from less far beside the target are about as good
_BESIDE_PX = 1, 3  # of a pixel: from how far off it may have its depth, where that has an edge
_LEAST_EDGE = 0.01  # of the slab: a side that is closer to a pixel's own height shows the same
# Of the slab: how far off a scaffold is taken to be. Over eight scenes 0.03 loses 0.03 dB on average, 0.006 is as good
_SCAFFOLD_SPREAD = 0.012


class Found(NamedTuple):
    """What a volume says of heights in the slab: those compared, the share of each, and their mean."""

    compared: Float[Tensor, "p y x"]
    share: Float[Tensor, "p y x"]
    height: Float[Tensor, "y x"]


class Seen(NamedTuple):
    """A target as the network sees it. found: by each volume, at its size.

    guesses: heights of what each input shows, from that input alone. seen: by some input.
    """

    colour: Float[Tensor, "3 h w"]
    depth: Float[Tensor, "h w"]
    confidence: Float[Tensor, "h w"]
    seen: Bool[Tensor, "h w"]
    found: tuple[Found, ...]
    guesses: Float[Tensor, "v 1 _ _"]


class Given(NamedTuple):
    """What the network is given of the inputs, and of scaffolds where there are any (0 where these have holes).

    rgba: in [0, 1]. fine: what is blended, FINER times as wide and high. even: colours at the network's own exposure.
    scaffolds: depths at the inputs. start: depth at the target.
    """

    rgba: Float[Tensor, "v 4 y x"]
    fine: Float[Tensor, "v 3 y2 x2"]
    even: Float[Tensor, "v 3 y x"]
    scaffolds: Float[Tensor, "v 1 y x"] | None = None
    start: Float[Tensor, "h w"] | None = None


class Sight(NamedTuple):
    """A target, and the inputs that look at what it sees."""

    target: Target
    inputs: Inputs
    given: Given

    def at(
        self, depth: Float[Tensor, "h w"]
    ) -> tuple[Float[Tensor, "v 1 h w 2"], Float[Tensor, "v 1 h w"], Float[Tensor, "v 1 h w"]]:
        """Return where the target's points lie in each input [px], 1 where it sees them, and how far beside the target it looks
        (1 - cosine).
        """
        xy_px, inside = self.inputs.project(self.target, depth[None])
        seen = (inside & (lookup(self.given.rgba[:, 3:], xy_px, 1)[:, :, 0] > _LEAST_ALPHA)).float()
        if self.given.scaffolds is not None:
            seen = seen * ~self.inputs.hidden(self.target, depth, self.given.scaffolds, xy_px)[:, None]
        return xy_px, seen, 1 - self.inputs.cosines(self.target, depth)[:, None]


class SweepNetwork(nn.Module):
    """All layers."""

    def __init__(self, config: SweepConfig) -> None:
        super().__init__()
        self.config = config
        wide = config.features
        self.at_full = nn.Sequential(_conv(3, _NARROW), _conv(_NARROW, _NARROW))
        self.at_half = nn.Sequential(_halving(_NARROW, wide), _conv(wide, wide))
        self.at_quarter = nn.Sequential(_halving(wide, 2 * wide), _conv(2 * wide, 2 * wide))
        self.at_eighth = nn.Sequential(_halving(2 * wide, 3 * wide), _conv(3 * wide, 3 * wide))
        self.around = nn.Conv2d(3 * wide, 2 * wide, 1)
        self.guess = nn.Conv2d(2 * wide, 1, 1)
        self.coarse_features = nn.Conv2d(2 * wide, wide, 1)
        self.fine_features = nn.Conv2d(3 * wide, _NARROW, 1)
        self.coarse = Volume(wide, deep=True)
        self.fine = Volume(_NARROW, deep=False)
        self.blend = Blend(_NARROW)

    def forward(self, target: Target, inputs: Inputs, given: Given) -> Seen:
        """Predict a target."""
        coarse_maps, fine_maps, guesses = self._features(given.even)
        holes = given.rgba[:, 3:] <= _LEAST_ALPHA
        used = (~holes).float() if holes.any() else None  # most inputs have none, and need not be looked up
        half = target.at_stride(FINE)
        start, known = _start(target, given.start)
        volumes, confidence = [], torch.ones_like(half.rise)
        if known.all():
            middle, reach = start, torch.full_like(start, _SCAFFOLD_SPREAD)
        else:
            coarse, spread, sure = self._coarse(target.at_stride(COARSE), inputs, coarse_maps, used)
            volumes.append(coarse)
            reach = _at(half, spread).detach().clamp(_LEAST_SPREAD / self.config.planes, _MOST_SPREAD)
            middle = torch.where(known, start, _at(half, coarse.height).detach())
            reach = torch.where(known, torch.full_like(start, _SCAFFOLD_SPREAD), reach)
            confidence = torch.where(known, confidence, _at(half, sure))
        steps = torch.linspace(-_BEYOND, _BEYOND, self.config.fine_planes, device=middle.device)[:, None, None]
        steps = steps.expand(-1, *middle.shape)
        compared = middle + steps * reach
        share = self.fine(half, inputs, fine_maps, used, compared, steps, FINE)
        found = (share * steps).sum(dim=0)
        off = found * reach
        volumes.append(Found(compared, share, middle + off))
        step = 2 * _BEYOND / (self.config.fine_planes - 1)
        confidence = confidence * (share * ((steps - found).abs() <= step)).sum(dim=0)
        depth = target.depth_at(self._sharp(target, given.start, off, middle + off))
        colour, seen = self.blend(Sight(target, inputs, given), depth, fine_maps)
        return Seen(colour, depth, _at(target, confidence).detach(), seen, tuple(volumes), guesses)

    @staticmethod
    def _sharp(
        target: Target, start: Float[Tensor, "h w"] | None, off: Float[Tensor, "y x"], found: Float[Tensor, "y x"]
    ) -> Float[Tensor, "h w"]:
        """Return heights at full size: a scaffold's own edges are sharper than enlarged ones."""
        whole = _at(target, found)
        if start is None:
            return whole
        return torch.where(start > 0, target.height_of(start) + _at(target, off), whole)

    def _coarse(
        self, target: Target, inputs: Inputs, maps: Float[Tensor, "v c y x"], used: Float[Tensor, "v 1 y2 x2"] | None
    ) -> tuple[Found, Tensor, Tensor]:
        """Return what fits, the spread of it, and the share of what is within a step and a half of the mean."""
        planes = self.config.planes
        heights = ((torch.arange(planes, device=maps.device) + 0.5) / planes)[:, None, None].expand(
            -1, *target.rise.shape
        )
        share = self.coarse(target, inputs, maps, used, heights, heights, COARSE)
        low = (share * heights).sum(dim=0)
        spread = (share * (heights - low) ** 2).sum(dim=0).clamp(min=1e-8).sqrt()
        return Found(heights, share, low), spread, (share * ((heights - low).abs() <= 1.5 / planes)).sum(dim=0)

    def _features(self, even: Float[Tensor, "v 3 y x"]) -> tuple[Tensor, Tensor, Tensor]:
        """Return the maps that the volumes compare (features, the colours themselves, guessed heights), and the guesses."""
        half = self.at_half(self.at_full(_channels_last(even * 2 - 1)))
        quarter = self.at_quarter(half)
        wide = self.around(self.at_eighth(quarter))
        quarter = quarter + _resized(wide, quarter)
        guess = self.guess(quarter).sigmoid()
        back = _resized(quarter, half)
        pairs = ((self.coarse_features(quarter), COARSE), (self.fine_features(torch.cat([half, back], 1)), FINE))
        coarse, fine = (
            torch.cat([maps, _shrunk(even, stride, maps) * 2 - 1, _resized(guess, maps)], dim=1)
            for maps, stride in pairs
        )
        return coarse, fine, guess


def _start(target: Target, depth: Float[Tensor, "h w"] | None) -> tuple[Float[Tensor, "y x"], Bool[Tensor, "y x"]]:
    """Return the heights of a scaffold at the fine size, and where it has any."""
    half = target.at_stride(FINE).rise
    if depth is None:
        return torch.zeros_like(half), torch.zeros_like(half, dtype=torch.bool)
    there = (depth > 0).float()
    share = F.avg_pool2d(there[None], FINE)[0]
    heights = F.avg_pool2d((target.height_of(depth) * there)[None], FINE)[0]
    return heights / share.clamp(min=1e-3), share > 0


class Volume(nn.Module):
    """How well the inputs agree at each of some heights, as shares that sum to 1 over them."""

    def __init__(self, features: int, deep: bool) -> None:
        super().__init__()
        wide = 2 * _INSIDE
        self.enter = nn.Conv2d(2 * (features + 3) + 4, _INSIDE, 1)
        self.near = PlaneConv(_INSIDE, _INSIDE)
        self.wide = nn.Sequential(PlaneConv(_INSIDE, wide, 2), PlaneConv(wide, wide)) if deep else None
        self.wider = nn.Sequential(PlaneConv(wide, wide, 2), PlaneConv(wide, wide)) if deep else None
        self.back = nn.Conv2d(wide, _INSIDE, 1) if deep else None
        self.more = PlaneConv(_INSIDE, _INSIDE)
        self.leave = PlaneConv(_INSIDE, 1, rectified=False)
        self.trust = nn.Parameter(torch.tensor(3.0))  # log of the weight of plain colour differences: a sweep as such

    def forward(
        self,
        target: Target,
        inputs: Inputs,
        maps: Float[Tensor, "v c y x"],
        used: Float[Tensor, "v 1 y2 x2"] | None,
        heights: Float[Tensor, "p h w"],
        place: Float[Tensor, "p h w"],
        stride: int,
    ) -> Float[Tensor, "p h w"]:
        """Compare maps at heights of the target's rays, where inputs are used.

        used: 0 where an input is masked or shows nothing; None if that is nowhere. place: what the network is told of where a
        height is.
        """
        xy_px, inside = inputs.project(target, target.depth_at(heights))
        if used is not None:
            inside = inside & (lookup(used, xy_px, 1)[:, 0] > _LEAST_ALPHA)
        seen, count = inside.float(), inside.sum(dim=0)
        shown, guessed = lookup(maps, xy_px, stride).split([maps.shape[1] - 1, 1], dim=1)
        mean, variance = _statistics(shown, seen, count)
        off = guessed[:, 0] - heights
        least = torch.where(inside, off.abs(), torch.ones_like(off)).amin(dim=0)
        typical = (off * seen).sum(dim=0) / count.clamp(min=1)
        differ = variance[-3:].mean(dim=0)
        told = torch.stack([count / len(maps), place, typical, least])
        x = self.near(_each(self.enter, torch.cat([variance, mean, told])))
        if self.wide is not None and self.wider is not None and self.back is not None:
            wide = self.wide(x)
            wide = wide + _enlarged(self.wider(wide), wide)
            x = x + _enlarged(self.back(wide), x)
        x = self.more(x)
        logits = self.leave(x)[:, 0] - self.trust.exp() * differ * (count > 1) - 2.0 * (count < 2)
        return logits.softmax(dim=0)


class PlaneConv(nn.Module):
    """A 3 x 3 x 3 convolution over planes (p c h w), each one picture of a batch.

    Three kernels of 3 x 3, whose results are added one plane apart, are the same and five to ten times faster on a CPU.
    """

    def __init__(self, channels: int, out: int, stride: int = 1, rectified: bool = True) -> None:
        super().__init__()
        self.each = nn.Conv2d(channels, 3 * out, 3, stride=stride, padding=1)
        self.stride, self.rectified = stride, rectified

    def forward(self, x: Float[Tensor, "p c h w"]) -> Float[Tensor, "p2 c2 h2 w2"]:
        """Convolve; a stride leaves out planes too."""
        x = _Stacked.apply(self.each(x))[:: self.stride]
        return F.leaky_relu(x, _SLOPE) if self.rectified else x


class _Stacked(torch.autograd.Function):
    """Add what each plane (p 3c h w) has for the plane below it, for itself, and for the plane above: (p c h w).

    The same as slices that are padded and added, whose gradients torch makes in many more steps.
    """

    @staticmethod
    def forward(_: object, x: Tensor) -> Tensor:
        before, own, after = x.chunk(3, dim=1)
        total = own.clone(memory_format=torch.channels_last)
        total[1:] += before[:-1]
        total[:-1] += after[1:]
        return total

    @staticmethod
    def backward(_: object, *gradients: Tensor) -> Tensor:
        of_total = gradients[0]
        p, c, h, w = of_total.shape
        each = of_total.new_zeros((p, h, w, 3, c)).movedim(-1, 1).movedim(-1, 1)
        each[:-1, 0], each[:, 1], each[1:, 2] = of_total[1:], of_total, of_total[:-1]
        return each.flatten(1, 2)


class Blend(nn.Module):
    """Colour as a weighted mean of the inputs' pixels, and a small network for what it leaves."""

    def __init__(self, features: int) -> None:
        super().__init__()
        self.each = nn.Sequential(_conv(3 + (features + 3 + 1) + 3 + 2, 16), _conv(16, 16))
        self.own, self.of_all = nn.Conv2d(16, 16, 3, padding=1), nn.Conv2d(2 * 16, 16, 3, padding=1, bias=False)
        self.vote = nn.Conv2d(16, 1, 3, padding=1)
        self.enter, self.down, self.deep = _conv(16 + 3 + 1, 16), _halving(16, 32), _conv(32, 32)
        self.up, self.leave = nn.Conv2d(32, 16, 1), nn.Conv2d(16, 3, 3, padding=1)
        self.edges = Edges(16)
        for layer in (self.vote, self.leave, self.edges.leave):  # begin as a blend by viewing angle alone
            for parameter in layer.parameters():
                nn.init.zeros_(parameter)

    def forward(
        self, sight: Sight, depth: Float[Tensor, "h w"], maps: Float[Tensor, "v c y2 x2"]
    ) -> tuple[Float[Tensor, "3 h w"], Bool[Tensor, "h w"]]:
        """Return the colours at a depth, and where any input shows them."""
        xy_px, seen, angle = sight.at(depth)
        known = lookup(sight.given.even, xy_px, 1)[:, :, 0]
        heights = sight.target.height_of(depth)
        features, guess = lookup(maps, xy_px, FINE)[:, :, 0].split([maps.shape[1] - 1, 1], dim=1)
        above = guess - heights  # an input that shows something higher there does not see the point
        mean = _mean(known, seen)
        told = torch.cat([known * 2 - 1, features, above * 5, (known - mean) * 4, seen, angle * 5], dim=1)
        each = self.each(_channels_last(F.avg_pool2d(told, 2)))
        seen_half = F.avg_pool2d(seen, 2)
        mean_each, most = _mean(each, seen_half), each.amax(dim=0, keepdim=True)
        together = self.own(each) + self.of_all(torch.cat([mean_each, most], dim=1))
        votes = _resized(self.vote(F.leaky_relu(together, _SLOPE)), seen)
        own = Shown.of(fine_colours(sight.target, sight.inputs, sight.given.fine, heights), seen, angle, votes)
        context = _resized(mean_each, seen)[0]
        colour, some = self.edges(sight, heights, votes, own, context)
        colour = _filled(colour, some)
        x = self.enter(_channels_last(torch.cat([context, colour * 2 - 1, some])[None]))
        deep = _resized(self.up(self.deep(self.down(x))), x)
        # An input beside the target shows what is there: what is learned of renders would make a photograph too sharp
        aside = torch.where(seen > 0, angle, torch.ones_like(angle)).amin(dim=0)
        return colour + self.leave(x + deep)[0] * (aside / (aside + _ASIDE)), own.share[0] > 0


class Shown(NamedTuple):
    """What the inputs show at some depth: blended, how far they differ, and the share of them that see it."""

    colour: Float[Tensor, "3 h w"]
    spread: Float[Tensor, "1 h w"]
    share: Float[Tensor, "1 h w"]

    @classmethod
    def of(
        cls,
        colours: Float[Tensor, "v 3 h w"],
        seen: Float[Tensor, "v 1 h w"],
        angle: Float[Tensor, "v 1 h w"],
        votes: Float[Tensor, "v 1 h w"],
    ) -> Shown:
        """Blend colours, by the votes and by how far beside the target each input looks (1 - cosine)."""
        weight = (votes + torch.log(seen + 1e-4) - torch.log(angle + _ASIDE)).softmax(dim=0)
        colour = (colours * weight).sum(dim=0)
        variance = ((colours - colour) ** 2).mean(dim=1, keepdim=True)
        return cls(colour, ((variance * weight).sum(dim=0) + 1e-6).sqrt(), seen.mean(dim=0))


class Edges(nn.Module):
    """Colour where the depth has an edge: a mixture of what the inputs show at the depths of its two sides.

    The edge may stand a pixel or more beside the true one: one depth is then right or altogether wrong, a mixture errs less.
    """

    def __init__(self, context: int) -> None:
        super().__init__()
        sides = 2 * len(_BESIDE_PX)
        self.mix = nn.Sequential(_conv(5 * (1 + sides) + sides + context, 16), _conv(16, 16))
        self.leave = nn.Conv2d(16, 1 + sides, 3, padding=1)

    def forward(
        self,
        sight: Sight,
        heights: Float[Tensor, "h w"],
        votes: Float[Tensor, "v 1 h w"],
        own: Shown,
        context: Float[Tensor, "c h w"],
    ) -> tuple[Float[Tensor, "3 h w"], Float[Tensor, "1 h w"]]:
        """Return the colours, and 1 where any input shows any of them. own: what is shown at the heights."""
        sides = [side for px in _BESIDE_PX for side in (_highest(heights, px), -_highest(-heights, px))]
        shown = [own, *(_shown_at(sight, side, votes, own, (side - heights).abs()) for side in sides)]
        told = [own.colour * 2 - 1, *((one.colour - own.colour) * 4 for one in shown[1:])]
        told += [one.spread * 10 for one in shown] + [one.share for one in shown]
        gaps = (torch.stack(sides) - heights) * 5
        share = torch.cat([one.share for one in shown]) > 0
        mixed = self.leave(self.mix(_channels_last(torch.cat([*told, gaps, context])[None])))[0]
        mixed = mixed + torch.log(share + 1e-4)
        weight = torch.cat([mixed[:1] + math.log(len(sides)), mixed[1:]]).softmax(dim=0)  # begin as half of its own
        colour = torch.stack([one.colour * part for one, part in zip(shown, weight, strict=True)]).sum(dim=0)
        return colour, share.any(dim=0, keepdim=True).float()


def _highest(heights: Float[Tensor, "h w"], px: int) -> Float[Tensor, "h w"]:
    """Return the highest of the heights that are so many pixels off or less."""
    wide = 2 * px + 1
    return F.max_pool2d(F.max_pool2d(heights[None], (1, wide), 1, (0, px)), (wide, 1), 1, (px, 0))[0]


def _shown_at(
    sight: Sight,
    heights: Float[Tensor, "h w"],
    votes: Float[Tensor, "v 1 h w"],
    own: Shown,
    off: Float[Tensor, "h w"],
) -> Shown:
    """Return what the inputs show at heights that are this far off a pixel's own, where that is far enough, else `own`.

    These pixels are few, and are looked up as one row.
    """
    far = off > _LEAST_EDGE
    target = sight.target
    some = Target(target.rays[far][None], target.rise[far][None], target.height, target.far)
    xy_px, seen, angle = sight._replace(target=some).at(some.depth_at(heights[far][None]))
    there = Shown.of(lookup(sight.given.fine, xy_px, 1 / FINER)[:, :, 0], seen, angle, votes[..., far][:, :, None])
    return Shown(*(whole.masked_scatter(far, part) for whole, part in zip(own, there, strict=True)))


def _mean(values: Float[Tensor, "v c *n"], seen: Float[Tensor, "v 1 *n"]) -> Float[Tensor, "1 c *n"]:
    return (values * seen).sum(dim=0, keepdim=True) / seen.sum(dim=0, keepdim=True).clamp(
        min=0.25
    )  # `seen` counts in quarters


def _statistics(
    values: Float[Tensor, "v c p h w"], seen: Float[Tensor, "v p h w"], count: Int[Tensor, "p h w"]
) -> tuple[Float[Tensor, "c p h w"], Float[Tensor, "c p h w"]]:
    """Return mean and variance of what is seen; view by view, as arrays of one view are faster to go over again."""
    weights = seen / count.clamp(min=1)
    mean = torch.zeros_like(values[0])
    for value, weight in zip(values, weights, strict=True):
        mean = torch.addcmul(mean, value, weight)
    variance = torch.zeros_like(mean)
    for value, weight in zip(values, weights, strict=True):
        variance = torch.addcmul(variance, (value - mean) ** 2, weight)
    return mean, variance


def _each(layer: nn.Conv2d, values: Float[Tensor, "c p h w"]) -> Float[Tensor, "p c2 h w"]:
    """Apply a convolution of 1 x 1 to planes, of which each comes out as a picture with channels last."""
    found = F.linear(values.flatten(1).T, layer.weight[:, :, 0, 0], layer.bias)
    return found.unflatten(0, values.shape[1:]).movedim(-1, 1)


def _filled(colour: Float[Tensor, "3 h w"], some: Float[Tensor, "1 h w"]) -> Float[Tensor, "3 h w"]:
    """Return colours continued smoothly to where nothing is seen: means over ever larger squares of what is."""
    parts = torch.cat([colour * some, some])[None]
    filled, known = colour, some > 0
    while min(parts.shape[-2:]) > 1 and not bool(known.all()):
        parts = F.avg_pool2d(parts, 2, ceil_mode=True)
        found = _resized(parts, colour)[0]
        share = found[3:]
        filled = torch.where(known, filled, found[:3] / share.clamp(min=1e-6))
        known = known | (share > 1e-6)
    return filled


def _channels_last(values: Float[Tensor, "n c h w"]) -> Float[Tensor, "n c h w"]:
    """Return values with the channels of a pixel beside each other: few of them are convolved 3 times as fast on a CPU."""
    return values.contiguous(memory_format=torch.channels_last)


def _resized(values: Float[Tensor, "v c y x"], like: Float[Tensor, "*c h w"]) -> Float[Tensor, "v c h w"]:
    return F.interpolate(values, size=like.shape[-2:], mode="bilinear", align_corners=False)


def _at(target: Target, values: Float[Tensor, "y x"]) -> Float[Tensor, "h w"]:
    return _resized(values[None, None], target.rise)[0, 0]


def _enlarged(planes: Float[Tensor, "q c y x"], like: Float[Tensor, "p c h w"]) -> Float[Tensor, "p c h w"]:
    size = (len(like), *like.shape[-2:])
    return F.interpolate(planes.movedim(1, 0)[None], size=size, mode="trilinear", align_corners=False)[0].movedim(0, 1)


def _shrunk(images: Float[Tensor, "v 3 y x"], stride: int, like: Tensor) -> Tensor:
    return F.avg_pool2d(images, stride)[..., : like.shape[-2], : like.shape[-1]]


def _conv(channels: int, out: int) -> nn.Module:
    return nn.Sequential(nn.Conv2d(channels, out, 3, padding=1), nn.LeakyReLU(_SLOPE))


def _halving(channels: int, out: int) -> nn.Module:
    """A kernel of 4 keeps the stated alignment: a feature stands for the middle of its square."""
    return nn.Sequential(nn.Conv2d(channels, out, 4, stride=2, padding=1), nn.LeakyReLU(_SLOPE))
