"""The paper's three edge cases of grouping: which way goes wrong, in a number and in a picture."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from io import BytesIO
from pathlib import Path

import numpy as np
from jaxtyping import Int
from PIL import Image, ImageDraw, ImageFont

from aug3d_core.geometry.raycast import Raycaster
from aug3d_core.groups.config import GroupingConfig
from aug3d_core.groups.methods import METHODS
from aug3d_core.groups.scene import Group, GroupingScene
from aug3d_core.overlap.columns import draw_columns
from aug3d_core.overlap.group_map import draw_groups
from aug3d_core.overlap.measures import member_overlaps, pairs_within
from aug3d_core.overlap.pair_overlaps import PairOverlaps, bad_share, is_bad
from aug3d_core.overlap.true_overlap import true_overlaps
from aug3d_core.town.truth.edge_cases import EdgeCase, K, exact_scene

_RIGHT = "shared"  # the way that should not go wrong
_GAP, _TITLE, _MAP_WIDTH = 40, 36, 480  # px
_WORST = 2  # members of a group that are shown beside its centre


@dataclass(frozen=True)
class Tried:
    """Every way of grouping on one edge case: its groups, centre first, and all overlaps within them."""

    case: EdgeCase
    scene: GroupingScene
    members: Mapping[str, Int[np.ndarray, "c k"]]
    overlaps: PairOverlaps

    def bad_share(self, method: str) -> float:
        """Return the share of bad members of a way."""
        return bad_share(member_overlaps(self.members[method], self.overlaps)) or 0.0


def try_case(case: EdgeCase, ways: Mapping[str, Group] = METHODS) -> Tried:
    """Group the views of a case in every way, at K = 10, with as many groups as views; exact overlaps."""
    surface = Raycaster(case.mesh.xyz, case.mesh.triangles)
    scene, everyone, config = exact_scene(case, surface), np.arange(len(case.views)), GroupingConfig()
    members = {
        method: group(scene, everyone, K, len(everyone), config, np.random.default_rng(config.seed))
        for method, group in ways.items()
    }
    pairs = np.concatenate([pairs_within(groups) for groups in members.values()])
    return Tried(case, scene, members, true_overlaps(case.views, surface, pairs))


def draw_cases(cases: Sequence[Tried], path: Path) -> None:
    """Write a PNG with a block for each case: maps of the ways that fail and of shared points, then the photographs.

    Shown is the worst group of the way that should fail, and of the others the group whose centre looks nearest.
    """
    blocks = [_block(tried) for tried in cases]
    width = sum(block.width + _GAP for block in blocks) - _GAP
    sheet = Image.new("RGB", (width, max(block.height for block in blocks)), "white")
    left = 0
    for block in blocks:
        sheet.paste(block, (left, 0))
        left += block.width + _GAP
    sheet.save(path)


def draw_worst(tried: Tried, way: str, path: Path) -> None:
    """Write the worst group of a way as a PNG: on the map, and the photographs of its centre and of its worst members."""
    groups = tried.members[way]
    overlap = member_overlaps(groups, tried.overlaps)
    group = int(np.argmax(is_bad(overlap).sum(axis=1)))
    worst = groups[group, 1 + np.argsort(overlap[group])[:_WORST]]
    columns = _columns(tried, {way: np.append(groups[group, 0], worst)[None]})
    chart = _chart(tried, {way: groups[[group]]}, _MAP_WIDTH)
    sheet = Image.new("RGB", (chart.width + columns.width, max(chart.height, columns.height)), "white")
    sheet.paste(chart, (0, 0))
    sheet.paste(columns, (chart.width, 0))
    sheet.save(path)


def _columns(tried: Tried, shown: Mapping[str, Int[np.ndarray, "1 k"]]) -> Image.Image:
    case = tried.case
    surface = Raycaster(case.mesh.xyz, case.mesh.triangles)

    def photo(view: int) -> Image.Image:
        views = case.views
        rendered = surface.render(case.mesh, views.cam_from_world[view], views.intrinsics[view], views.size[view])
        return Image.fromarray(np.where(rendered.alpha[..., None] > 0, rendered.rgb, np.uint8(245)))

    return draw_columns(photo, case.views, shown, tried.overlaps)


def _chart(tried: Tried, shown: Mapping[str, Int[np.ndarray, "1 k"]], width: int) -> Image.Image:
    chart = BytesIO()
    draw_groups(tried.scene, shown, tried.overlaps, chart)
    with Image.open(chart) as image:
        height = round(image.height * width / image.width)
        return image.convert("RGB").resize((width, height), Image.Resampling.LANCZOS)


def _block(tried: Tried) -> Image.Image:
    shown, case = _shown(tried), tried.case
    columns = _columns(tried, shown)
    chart = _chart(tried, {way: shown[way] for way in (*case.fails, _RIGHT)}, columns.width)
    block = Image.new("RGB", (columns.width, _TITLE + chart.height + columns.height), "white")
    worst = ", ".join(f"{way} {tried.bad_share(way):.0%}" for way in (*case.fails, _RIGHT))
    title = f"{case.name}: bad members over all groups: {worst}"
    ImageDraw.Draw(block).text((4, 6), title, fill="black", font=ImageFont.load_default(20))
    block.paste(chart, (0, _TITLE))
    block.paste(columns, (0, _TITLE + chart.height))
    return block


def _shown(tried: Tried) -> dict[str, Int[np.ndarray, "1 k"]]:
    failing, look = tried.members[tried.case.fails[0]], tried.scene.look_in_world
    worst = int(np.argmax(is_bad(member_overlaps(failing, tried.overlaps)).sum(axis=1)))
    place = look[failing[worst, 0]]
    shown = {}
    for way, groups in tried.members.items():
        nearest = int(np.argmin(np.linalg.norm(look[groups[:, 0]] - place, axis=1)))
        shown[way] = groups[[worst if way == tried.case.fails[0] else nearest]]
    return shown
