"""Buildings as triangles. Local x runs along the ridge, y across it, z up from the ground; the front faces -y."""

from __future__ import annotations

import numpy as np

from aug3d_core.town.generator.atlas import Atlas
from aug3d_core.town.generator.facades import WallStyle, paint_wall, wall_style
from aug3d_core.town.generator.model import Frame, Model
from aug3d_core.town.generator.plan import Building
from aug3d_core.town.generator.roofs import TILES, Cover, paint_roof
from aug3d_core.town.generator.swatches import Swatches

_EAVES_OUT = 0.45
_VERGE_OUT = 0.30
_FOOT = -0.6  # walls go into the ground, which is not level
_PARAPET = 0.55


def add_building(model: Model, atlas: Atlas, swatches: Swatches, b: Building, rng: np.random.Generator) -> float:
    """Append a building and return the height of its highest roof (m)."""
    style = wall_style(b.use, rng)
    return {"gable": _gable, "hip": _hip, "flat": _flat}[b.roof](model, atlas, swatches, b, style, rng)


def _walls(
    model: Model, atlas: Atlas, b: Building, height: float, style: WallStyle, rng: np.random.Generator, sides: int = 4
) -> None:
    """Append the first `sides` of front, back, right and left wall."""
    x, y = b.width_m / 2, b.depth_m / 2
    corners = [((-x, -y), (x, -y)), ((x, y), (-x, y)), ((x, -y), (x, y)), ((-x, y), (-x, -y))]
    for i, ((ax, ay), (bx, by)) in enumerate(corners[:sides]):
        width = float(np.hypot(bx - ax, by - ay))
        patch = atlas.add(paint_wall(width, height, b.eaves_m, style, i == 0, rng))
        model.polygon(b.frame, [(ax, ay, _FOOT), (bx, by, _FOOT), (bx, by, height), (ax, ay, height)], patch)


def _gable(
    model: Model, atlas: Atlas, swatches: Swatches, b: Building, style: WallStyle, rng: np.random.Generator
) -> float:
    x, y, slope = b.width_m / 2, b.depth_m / 2, np.tan(np.radians(b.pitch_deg))
    eaves, ridge = b.eaves_m, b.eaves_m + b.depth_m / 2 * slope
    _walls(model, atlas, b, eaves, style, rng, sides=2)
    share = (eaves - _FOOT) / (ridge - _FOOT)
    for side in (1, -1):
        patch = atlas.add(paint_wall(b.depth_m, ridge, eaves + 1.2, style, False, rng))
        ends = [(side * x, -side * y, _FOOT), (side * x, side * y, _FOOT), (side * x, side * y, eaves)]
        outline = [*ends, (side * x, 0, ridge), (side * x, -side * y, eaves)]
        model.polygon(b.frame, outline, patch, [(0, 0), (1, 0), (1, share), (0.5, 1), (0, share)])
    colour = _tile_colour(b, rng)
    dormers = b.use == "row" and ridge - eaves >= 3.2 and rng.random() < 0.55
    usable = 0.0 if b.use == "shed" or dormers else 2 * x - 1
    low, out = eaves - _EAVES_OUT * slope + 0.06, y + _EAVES_OUT
    ex = x + _VERGE_OUT if b.use != "row" else x
    for side in (1, -1):
        patch = atlas.add(
            paint_roof(2 * ex, float(np.hypot(out, ridge - low)), _cover(b, "tiles"), colour, usable, rng)
        )
        top = ridge + 0.06
        plane = [
            (-side * ex, -side * out, low),
            (side * ex, -side * out, low),
            (side * ex, 0, top),
            (-side * ex, 0, top),
        ]
        model.polygon(b.frame, plane, patch)
    if b.use != "shed":
        _chimneys(model, swatches, b, ridge, rng)
    if dormers:
        lid = atlas.add(paint_roof(1.8, 2.4, _cover(b, "tiles"), colour, 0.0, rng))
        _dormers(model, atlas, (swatches.metal, lid), b, slope, ridge, style, rng)
    return ridge


def _hip(
    model: Model, atlas: Atlas, swatches: Swatches, b: Building, style: WallStyle, rng: np.random.Generator
) -> float:
    x, y, slope = b.width_m / 2, b.depth_m / 2, np.tan(np.radians(b.pitch_deg))
    _walls(model, atlas, b, b.eaves_m, style, rng)
    short = min(x, y)
    ridge, low = b.eaves_m + short * slope, b.eaves_m - _EAVES_OUT * slope
    colour = _tile_colour(b, rng)
    ex, ey = x + _EAVES_OUT, y + _EAVES_OUT
    tops = [(-(x - short), -(y - short)), (x - short, -(y - short)), (x - short, y - short), (-(x - short), y - short)]
    base = [(-ex, -ey), (ex, -ey), (ex, ey), (-ex, ey)]
    slant = float(np.hypot(short + _EAVES_OUT, ridge - low))
    for i in range(4):
        j = (i + 1) % 4
        long = float(np.hypot(base[j][0] - base[i][0], base[j][1] - base[i][1]))
        inset = (short + _EAVES_OUT) / long
        usable = 0.0 if b.use == "shed" else max(0.0, 0.9 * long - inset * long)
        patch = atlas.add(paint_roof(long, slant, _cover(b, "tiles"), colour, usable, rng))
        plane = [(*base[i], low), (*base[j], low), (*tops[j], ridge), (*tops[i], ridge)]
        uv = [(0, 0), (1, 0), (1 - inset, 1), (inset, 1)]
        corners = 3 if np.allclose(tops[i], tops[j]) else 4  # a plane on a short side ends in a point
        model.polygon(b.frame, plane[:corners], patch, uv[:corners])
    if b.use != "shed":
        _chimneys(model, swatches, b, ridge, rng)
    return ridge


def _flat(
    model: Model, atlas: Atlas, swatches: Swatches, b: Building, style: WallStyle, rng: np.random.Generator
) -> float:
    x, y, roof, rim = b.width_m / 2, b.depth_m / 2, b.eaves_m, b.eaves_m + _PARAPET
    _walls(model, atlas, b, rim, style, rng)
    cover: Cover = "metal" if b.use == "hall" and rng.random() < 0.5 else "gravel"
    grey = rng.uniform(0.45, 0.68)
    colour = (grey, grey * rng.uniform(0.95, 1.0), grey * rng.uniform(0.88, 1.0))
    patch = atlas.add(paint_roof(b.width_m, b.depth_m, _cover(b, cover), colour, 0.0, rng))
    inner = 0.3
    ix, iy = x - inner, y - inner
    model.polygon(b.frame, [(-x, -y, roof), (x, -y, roof), (x, y, roof), (-x, y, roof)], patch)
    outside, inside = [(-x, -y), (x, -y), (x, y), (-x, y)], [(-ix, -iy), (ix, -iy), (ix, iy), (-ix, iy)]
    for i in range(4):
        j = (i + 1) % 4
        model.polygon(
            b.frame, [(*outside[i], rim), (*outside[j], rim), (*inside[j], rim), (*inside[i], rim)], swatches.concrete
        )
        model.polygon(
            b.frame, [(*inside[j], roof), (*inside[i], roof), (*inside[i], rim), (*inside[j], rim)], swatches.concrete
        )
    return rim if b.bare_roof else max(rim, _roof_boxes(model, swatches, b, rng))


def _cover(b: Building, cover: Cover) -> Cover:
    return "bare" if b.bare_roof else cover


def _tile_colour(b: Building, rng: np.random.Generator) -> tuple[float, float, float]:
    if b.use == "shed":
        return (0.42, 0.40, 0.38)
    return tuple(np.array(TILES[rng.integers(len(TILES))]) + rng.normal(0, 0.015, 3))


def _chimneys(model: Model, swatches: Swatches, b: Building, ridge: float, rng: np.random.Generator) -> None:
    for _ in range(int(rng.integers(1, 3))):
        x, y, half = rng.uniform(-0.3, 0.3) * b.width_m, rng.uniform(-0.8, 0.8), rng.uniform(0.25, 0.45)
        low, high = ridge - 1.6, ridge + rng.uniform(0.7, 1.1)
        model.box(b.frame, (x - half, y - 0.3, low), (x + half, y + 0.3, high), swatches.brick, swatches.concrete)
        model.box(
            b.frame,
            (x - half + 0.12, y - 0.15, high),
            (x + half - 0.12, y + 0.15, high + 0.2),
            swatches.dark,
            swatches.dark,
        )


def _dormers(
    model: Model, atlas: Atlas, patches: tuple[int, int], b: Building, slope: float, ridge: float, style: WallStyle,
    rng: np.random.Generator,
) -> None:  # fmt: skip
    """Let windows stand out of a steep roof, with cheeks and a tiled lid (`patches`) that slopes back to the ridge."""
    cheek, lid = patches
    count = 2 if b.width_m > 7.5 else 1
    front, foot = -(b.depth_m / 2 - 0.9), b.eaves_m + 0.9 * slope
    high = min(foot + 1.5, ridge - 0.6)
    back = -(ridge - high - 0.25) / slope  # where the lid meets the roof
    for x in (np.arange(count) - (count - 1) / 2) * b.width_m / 2:
        for turn in (0.0, np.pi):
            place = Frame(b.frame.x, b.frame.y, b.frame.yaw_rad + turn)
            window = atlas.add(paint_wall(1.6, 1.9, 1.0, style, False, rng))
            x0, x1, low = x - 0.8, x + 0.8, foot - 0.2
            model.polygon(place, [(x0, front, low), (x1, front, low), (x1, front, high), (x0, front, high)], window)
            for side in (x0, x1):
                model.polygon(
                    place,
                    [(side, front, low), (side, back, high + 0.25), (side, front, high)],
                    cheek,
                    [(0, 0), (1, 1), (0, 1)],
                )
            eaves, verge = front - 0.2, 0.15
            corners = [(x0 - verge, eaves, high + 0.02), (x1 + verge, eaves, high + 0.02)]
            model.polygon(place, [*corners, (x1 + verge, back, high + 0.27), (x0 - verge, back, high + 0.27)], lid)


def _roof_boxes(model: Model, swatches: Swatches, b: Building, rng: np.random.Generator) -> float:
    """Put ventilators, a stair head and skylights on a flat roof; return the highest top."""
    roof, top = b.eaves_m, b.eaves_m
    if b.use == "flats":
        x = rng.uniform(-0.25, 0.25) * b.width_m
        model.box(b.frame, (x - 1.6, -1.4, roof), (x + 1.6, 1.6, roof + 2.3), swatches.concrete, swatches.concrete)
        top = roof + 2.3
    for _ in range(int(b.width_m * b.depth_m / 28)):
        x, y = rng.uniform(-0.42, 0.42) * b.width_m, rng.uniform(-0.38, 0.38) * b.depth_m
        wide, deep, high = rng.uniform(0.3, 1.1), rng.uniform(0.3, 0.8), rng.uniform(0.3, 1.1)
        kind = rng.choice(["metal", "concrete", "glass"])
        side, lid = (swatches.metal, swatches.glass) if kind == "glass" else (getattr(swatches, kind),) * 2
        model.box(b.frame, (x - wide, y - deep, roof), (x + wide, y + deep, roof + high), side, lid)
        if kind == "metal":
            model.box(
                b.frame,
                (x - wide / 2, y - deep / 2, roof),
                (x + wide / 2, y + deep / 2, roof + high + 0.06),
                side,
                swatches.dark,
            )
    return top
