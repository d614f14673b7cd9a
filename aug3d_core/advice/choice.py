"""The photographs that make up for most of what is missing, one after another.

Each is the one that adds most to those before it. No bound is known of how far that is from the best set: a photograph may
add more after another one, since a view takes only the few that are best for it.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from scipy.spatial import Delaunay, QhullError

from aug3d_core.advice.need import POOR, Look, look_of, need_of, offers
from aug3d_core.advice.site import HIGHER, Site
from aug3d_core.geometry.transforms import centres, forward
from aug3d_core.geometry.views import Views
from aug3d_core.run.errors import InputError

_APART = 4  # candidates along a picture
_MOST_PLACES = 1200  # with each heading
_SEED = 0
_MOST_ASKED = 600  # views that may be asked for
_MOST_TILT_DEG = 45.0


@dataclass(frozen=True)
class Advised:
    """A photograph to take. rank: from 1, by what it adds. adds: share of what was missing before all of them.

    poor: share of what it shows, as far as that was looked at, of which more than POOR is missing. hole: share that the mesh
    has nothing of. error: of the model where it looks, 1 as usual elsewhere. yaw_deg: clockwise from north (+y), of the upper
    edge of the picture. pitch_deg: of the gimbal, -90 straight down.
    """

    rank: int
    xyz: tuple[float, float, float]
    yaw_deg: float
    pitch_deg: float
    adds: float
    poor: float
    hole: float
    error: float


@dataclass(frozen=True)
class Choice:
    """advised: in order of rank. missing: of views that may be asked for, before any of them and after each, one more.

    before, after: what is missing of each sample of the site, 0 to 1; NaN where no view that may be asked for shows it.
    """

    advised: tuple[Advised, ...]
    missing: tuple[float, ...]
    before: Float[np.ndarray, " s"]
    after: Float[np.ndarray, " s"]

    @property
    def looked_at(self) -> float:
        """The share of the site that views which may be asked for show: of a large site, only where it is barest."""
        return float(np.isfinite(self.before).mean())


def candidates(
    site: Site, views: Views, bare: Float[np.ndarray, " s"], higher: float = 1.0
) -> tuple[Float[np.ndarray, "c 3"], Float[np.ndarray, "c 2"]]:
    """Return where cameras may stand, and their yaw and pitch [degrees]: tilted and turned as the flight was.

    Of a large site, only where the ground about which they aim is barest. higher: so many times as high above the ground as
    the flight was.
    """
    tilt, yaws = usual_look(views)
    wanted = site.area.middle(site.area.wanted)
    low, high, step = wanted.min(axis=0), wanted.max(axis=0), site.picture / _APART
    stand, turn = [], []
    for yaw in yaws:
        ahead = np.array([np.sin(np.radians(yaw)), np.cos(np.radians(yaw))])
        ahead *= site.height_flown(higher) * np.tan(np.radians(tilt))
        ends = zip(np.floor(-ahead / step), np.ceil((high - low - ahead) / step) + 1, strict=True)
        grid = low + step * np.stack(np.meshgrid(*(np.arange(*end) for end in ends)), axis=-1).reshape(-1, 2)
        aims = grid + ahead
        chosen = np.flatnonzero(site.area.has(aims))
        if len(chosen) > _MOST_PLACES:
            about = site.about(aims[chosen])
            barest = np.argsort([-bare[here].mean() if len(here) else 0.0 for here in about], kind="stable")
            chosen = np.sort(chosen[barest[:_MOST_PLACES]])
        stand.append(site.flown(grid[chosen], higher))
        turn.append(np.tile([yaw, tilt - 90.0], (len(chosen), 1)))
    return np.concatenate(stand), np.concatenate(turn)


def usual_look(views: Views) -> tuple[float, tuple[float, float]]:
    """Return the tilt from straight down, and the yaws of a camera there and back along the flight's lines [degrees].

    The axis is the mean of doubled angles: lines that are flown both ways have one.
    """
    down = np.degrees(np.arccos(np.clip(-forward(views.cam_from_world)[:, 2], -1, 1)))
    east, north = -views.cam_from_world[:, 1, :2].T  # of the upper edge
    axis = float(np.degrees(np.angle(np.exp(2j * np.arctan2(east, north)).mean())) / 2) % 180
    return min(float(np.median(down)), _MOST_TILT_DEG), (axis, axis + 180)


def pose(xyz: Float[np.ndarray, " 3"], yaw_deg: float, pitch_deg: float) -> Float[np.ndarray, "3 4"]:
    """Return the `cam_from_world` of a camera without roll, the upper edge of its picture towards yaw."""
    yaw, pitch = np.radians([yaw_deg, pitch_deg])
    z = np.array([np.sin(yaw) * np.cos(pitch), np.cos(yaw) * np.cos(pitch), np.sin(pitch)])
    x = np.array([np.cos(yaw), -np.sin(yaw), 0.0])
    rotation = np.stack([x, np.cross(z, x), z])
    return np.concatenate([rotation, (-rotation @ xyz)[:, None]], axis=1)


def asked_for(
    site: Site, views: Views, bare: Float[np.ndarray, " s"]
) -> tuple[Float[np.ndarray, "a 3"], Float[np.ndarray, "a 2"]]:
    """Return views that may be asked for, as candidates: the flight's own kind, among its cameras.

    Where cameras enclose nothing, being all in a line, they are all that aim at the site.
    """
    stand, turn = candidates(site, views, bare)
    try:
        inside = Delaunay(centres(views.cam_from_world)[:, :2]).find_simplex(stand[:, :2]) >= 0
    except QhullError:
        inside = np.zeros(len(stand), bool)
    among = np.flatnonzero(inside) if inside.any() else np.arange(len(stand))
    among = np.sort(np.random.default_rng(_SEED).permutation(among)[:_MOST_ASKED])
    return stand[among], turn[among]


def chosen(
    site: Site,
    views: Views,
    error: Float[np.ndarray, " s"],
    count: int,
    progress: Callable[[str, int, int], None],
) -> Choice:
    """Return so many photographs to take, fewer where none adds anything. error: of the model at each sample, 1 if as usual.

    Raises InputError where no view that may be asked for shows any of the site.
    """
    intrinsics, size = np.median(views.intrinsics, axis=0), np.median(views.size, axis=0).astype(int)

    def looks_of(what: str, stand: np.ndarray, turn: np.ndarray) -> list[Look]:
        looks: list[Look] = []
        for xyz, (yaw, pitch) in zip(stand, turn, strict=True):
            looks.append(look_of(site, pose(xyz, yaw, pitch), intrinsics, size))
            progress(what, len(looks), len(stand))
        return looks

    flown, seen = list[Look](), np.zeros(len(error))
    for view in range(len(views)):
        flown.append(look_of(site, views.cam_from_world[view], views.intrinsics[view], views.size[view]))
        seen[flown[-1].sample] += flown[-1].counts
        progress("photographs", view + 1, len(views))
    bare = np.exp(-seen)
    stand, turn = candidates(site, views, bare, HIGHER)
    looks = looks_of("places to stand", stand, turn)
    asked = [look for look in looks_of("views to predict", *asked_for(site, views, bare)) if len(look.sample)]
    if not asked or not looks:
        raise InputError(
            "no view like the flight's own shows any of the ground that it encloses",
            "give photographs that overlap, and a mesh of what they show",
        )
    need = need_of(asked, flown, error)
    offered = [*offers(asked, looks)]
    gains = np.zeros((len(asked), len(looks)), np.float32)
    for view, offer in enumerate(offered):
        gains[view, offer.photo] = need.added(view, offer)
    before = left = need.missing_at()
    missing, advised, taken = [need.missing], [], []
    for rank in range(1, count + 1):
        best = int(gains.sum(axis=0).argmax())
        better = np.flatnonzero(gains[:, best])
        if not len(better):
            break
        for view in better:
            offer = offered[view]
            need.take(view, offer.counts[np.searchsorted(offer.photo, best)])
            gains[view, offer.photo] = need.added(view, offer)
        taken.append(best)
        gains[:, taken] = 0
        missing.append(need.missing)
        adds = (missing[-2] - missing[-1]) / missing[0]
        advised.append(_advised(rank, stand[best], turn[best], looks[best], site, left, error, adds))
        left = need.missing_at()
    return Choice(tuple(advised), tuple(missing), before, left)


def _advised(
    rank: int,
    xyz: Float[np.ndarray, " 3"],
    turn: Float[np.ndarray, " 2"],
    look: Look,
    site: Site,
    left: Float[np.ndarray, " s"],
    error: Float[np.ndarray, " s"],
    adds: float,
) -> Advised:
    east, north, up = (float(value) for value in xyz)
    here = left[look.sample]
    known = np.isfinite(here)
    return Advised(
        rank=rank, xyz=(east, north, up), yaw_deg=float(turn[0]), pitch_deg=float(turn[1]),
        adds=adds, poor=float((here[known] > POOR).mean()), hole=float(site.in_hole[look.sample].mean()),
        error=float(np.average(error[look.sample][known], weights=here[known])),
    )  # fmt: skip
