"""What is wrong with photographs, as far as a first look tells, and what to do about it."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from datetime import timedelta
from itertools import pairwise
from typing import Literal, SupportsInt

import numpy as np
from jaxtyping import Bool, Float
from scipy.sparse.csgraph import connected_components

from aug3d_core.look.control import LEAST_MARKS
from aug3d_core.look.survey import Survey
from aug3d_core.photos.config import PhotosConfig
from aug3d_core.sfm.control import FEWEST as LEAST_CONTROL

Weight = Literal["stop", "warn", "note"]

_BLURRED = 0.35  # of the sharpness of the photographs around
_BRIGHTER = 1.8  # times as bright as those around, or as dark
_UNEVEN = 2.0  # the same over the whole flight
_AROUND = 5  # photographs before and after one
_BURNT = 0.2  # share of a picture without detail
_WANTED = 40  # fewer photographs are usually tested in two folds
_LEAST_OVERLAP, _WANTED_OVERLAP = 0.4, 0.6  # where the study of stability breaks, and what neighbours should have
_WANTED_SIDEWAYS, _JOINED = 0.35, 0.1  # of photographs of other lines; of those that can be joined at all
_APART = 6  # so many photographs later it is another line
_TOO_OFTEN = 0.15  # share of the steps that makes something a habit
_MOST_LOST = 0.5  # share of the photographs that show nothing of the next one
_STILL = 0.02  # of the width: the picture did not move
_FLIGHTS_APART = timedelta(minutes=30)
_ONE_PLACE_M = 2.0
_LEAST_POSITIONS = 3  # that give a scene metres and north
_GAPS = 0.02  # share of the enclosed ground


@dataclass(frozen=True)
class Finding:
    """weight: stop: it will not work; warn: the result suffers; note: good to know. names: of the photographs meant."""

    weight: Weight
    what: str
    to_do: str
    names: tuple[str, ...] = ()


def findings_of(survey: Survey) -> list[Finding]:
    """Return what is found, the gravest first."""
    found = [one for rule in _RULES for one in rule(survey)]
    return sorted(found, key=lambda one: ("stop", "warn", "note").index(one.weight))


def verdict_of(findings: Sequence[Finding]) -> str:
    """Return the whole in one sentence."""
    stops, warnings = (sum(one.weight == weight for one in findings) for weight in ("stop", "warn"))
    if stops:
        return "These photographs will not do as they are."
    if warnings:
        return f"These photographs can be used. {warnings} thing{'s' * (warnings > 1)} to look at first."
    return "These photographs look good."


def blurred(survey: Survey) -> Bool[np.ndarray, " n"]:
    """Return which photographs are much less sharp than those around them, as they are and at the same brightness."""
    sharpness = np.array([photo.sharpness for photo in survey.photos])
    ways = (
        sharpness,
        sharpness / _brightness(survey) ** 2,
    )  # an exposure scales differences, until a camera evens them out
    return np.all([one < _BLURRED * _usual_around(one) for one in ways], axis=0)


def exposed_unlike(survey: Survey) -> Bool[np.ndarray, " n"]:
    """Return which photographs are much brighter or darker than those around them."""
    brightness = _brightness(survey)
    usual = _usual_around(brightness)
    return np.maximum(brightness / usual, usual / brightness) > _BRIGHTER


def _brightness(survey: Survey) -> Float[np.ndarray, " n"]:
    return np.array([photo.brightness for photo in survey.photos]).clip(1 / 255)


def _usual_around(values: Float[np.ndarray, " n"]) -> Float[np.ndarray, " n"]:
    return np.array([np.median(values[max(i - _AROUND, 0) : i + _AROUND + 1]) for i in range(len(values))])


def _named(survey: Survey, which: Bool[np.ndarray, " n"]) -> tuple[str, ...]:
    return tuple(photo.name for photo, so in zip(survey.photos, which, strict=True) if so)


def _count(survey: Survey) -> Iterator[Finding]:
    least, count = PhotosConfig().min_photos, len(survey.photos)
    if count < least:
        usable = _say(count, "usable photograph", "usable photographs")
        yield Finding("stop", f"{usable}; at least {least} are needed.", "Take more.")
    elif count < _WANTED:
        yield Finding(
            "warn",
            f"{count} photographs: a small scene, which is tested in parts, each with a model of its own.",
            f"Take {_WANTED} or more.",
        )


def _unusable(survey: Survey) -> Iterator[Finding]:
    if survey.unusable:
        grave = len(survey.unusable) > len(survey.photos)
        reasons = sorted({reason.partition(":")[0] for reason in survey.unusable.values()})
        yield Finding(
            "stop" if grave else "warn",
            f"{_say(len(survey.unusable), 'photograph', 'photographs')} cannot be used ({', '.join(reasons)}).",
            "Copy damaged ones from the card again. The rest may stay: a run leaves them out.",
            tuple(survey.unusable),
        )
    if survey.same:
        yield Finding(
            "note",
            _say(
                len(survey.same),
                "photograph has the same bytes as another one and is left out.",
                "photographs have the same bytes as another one and are left out.",
            ),
            "Nothing.",
            tuple(survey.same),
        )


def _masks(survey: Survey) -> Iterator[Finding]:
    if survey.masked:
        yield Finding(
            "note",
            f"{_say(len(survey.masked), 'photograph has', 'photographs have')} a mask, which this look does not heed.",
            "Nothing.",
        )
    if survey.stray_masks:
        yield Finding(
            "warn",
            _say(
                len(survey.stray_masks),
                "mask lies beside no photograph and masks nothing.",
                "masks lie beside no photograph and mask nothing.",
            ),
            "Name the mask of IMG_1.JPG IMG_1_mask.png, and put it beside it.",
            tuple(survey.stray_masks),
        )


def _blur(survey: Survey) -> Iterator[Finding]:
    if (soft := blurred(survey)).any():
        yield Finding(
            "warn",
            _say(
                soft.sum(),
                "photograph is much less sharp than its neighbours.",
                "photographs are much less sharp than their neighbours.",
            ),
            f"Look at {_them(soft)}; delete what is blurred, unless it leaves a gap.",
            _named(survey, soft),
        )


def _exposure(survey: Survey) -> Iterator[Finding]:
    if not survey.photos:
        return
    if (unlike := exposed_unlike(survey)).any():
        yield Finding(
            "warn",
            _say(
                unlike.sum(),
                "photograph is much brighter or darker than its neighbours.",
                "photographs are much brighter or darker than their neighbours.",
            ),
            f"Look at {_them(unlike)}; such a picture is evened out, as far as it can be.",
            _named(survey, unlike),
        )
    darkest, brightest = np.quantile(_brightness(survey), [0.1, 0.9])
    if brightest > _UNEVEN * darkest:
        yield Finding(
            "warn",
            f"The brightest tenth is {brightest / darkest:.1f} times as bright as the darkest, or more.",
            "Fly with a fixed exposure, in one light; the model evens out what it can.",
        )
    burnt = np.array([photo.white > _BURNT for photo in survey.photos], bool)
    if burnt.any():
        yield Finding(
            "warn",
            f"{_say(burnt.sum(), 'photograph is', 'photographs are')} white over more than {_BURNT:.0%} of the picture.",
            "Expose less: what is white has no detail to match.",
            _named(survey, burnt),
        )


def _cameras(survey: Survey) -> Iterator[Finding]:
    cameras = sorted({photo.exif.camera for photo in survey.photos})
    if len(cameras) > 1:
        yield Finding(
            "note", f"{len(cameras)} cameras: {'; '.join(cameras)}.", "Nothing: each gets intrinsics of its own."
        )
    unknown = sum(photo.exif.focal_source == "none" for photo in survey.photos)
    if unknown:
        yield Finding(
            "note",
            f"{_say(unknown, 'photograph has', 'photographs have')} no focal length in EXIF.",
            "Use the camera's originals if you have them: a known focal length is a better start.",
        )


def _positions(survey: Survey) -> Iterator[Finding]:
    ground = survey.ground
    without = np.array([not np.isfinite(photo.exif.lat_deg) for photo in survey.photos], bool)
    if without.all():
        yield Finding(
            "note",
            "No positions by GPS: the scene will have no metres and no north, and there is no map here.",
            "Nothing, if you need neither.",
        )
        return
    if without.any():
        enough = (~without).sum() >= _LEAST_POSITIONS
        yield Finding(
            "note",
            f"{_say(without.sum(), 'photograph has', 'photographs have')} no position.",
            "Nothing." if enough else f"Nothing, if you need no metres: they take {_LEAST_POSITIONS} positions.",
            _named(survey, without),
        )
    if ground is None:
        return
    if ground.wild.any():
        yield Finding(
            "warn",
            f"{_say(ground.wild.sum(), 'photograph has', 'photographs have')} a position that cannot be right: "
            "far from those before and after.",
            "Nothing: wild positions are left out when the scene is placed.",
            _named(survey, ground.wild),
        )
    if ground.placed.sum() > 2 and np.linalg.norm(np.ptp(ground.enu_m[ground.placed], axis=0)) < _ONE_PLACE_M:
        yield Finding(
            "stop",
            f"All photographs were taken within {_ONE_PLACE_M:g} m: a camera that only turns sees no depth.",
            "Fly, and photograph from different places.",
        )


def _overlap(survey: Survey) -> Iterator[Finding]:
    if not survey.steps:
        return
    overlaps, matched = survey.overlaps, np.array([step.overlap > 0 for step in survey.steps])
    within = overlaps[overlaps > 0]  # a new line of the flight has nothing to do with the one before
    if not len(within):
        yield Finding(
            "stop", "No photograph shows anything of the next one.", "Fly so that neighbours overlap by 60 % or more."
        )
        return
    if survey.lost.mean() > _TOO_OFTEN:
        yield _lost(survey)
    if survey.lost.mean() > _MOST_LOST:
        return  # what is left says nothing of the flight
    middle = float(np.median(within))
    if middle < _WANTED_OVERLAP:
        yield Finding(
            "stop" if middle < _LEAST_OVERLAP else "warn",
            f"Neighbours overlap by {middle:.0%} (median). Below {_LEAST_OVERLAP:.0%} no poses are found.",
            "Fly again with 70 % or more along the line.",
        )
    strange = (overlaps > _LEAST_OVERLAP) & ~matched
    if survey.ground is not None and strange.mean() > _TOO_OFTEN:
        yield Finding(
            "warn",
            f"In {strange.sum()} of {_say(len(strange), 'pair', 'pairs')} of neighbours nothing was matched, though they "
            "overlap by their positions: leaves, water, sand or blur.",
            "Photograph more often, or from higher up, so that more of the picture stays the same.",
            _named(survey, np.append(strange, False)),
        )
    still = np.array([step.length < _STILL for step in survey.steps])
    if still.mean() > _TOO_OFTEN:
        yield Finding(
            "note",
            f"{_some_show(still)} what the one before shows: a video, or a drone that hovers.",
            "Run with --preset auto, which leaves them out.",
        )


def _lost(survey: Survey) -> Finding:
    timed = all(photo.exif.time for photo in survey.photos)
    to_do = "Fly so that neighbours overlap by 60 % or more. Leaves, water and blur can hide an overlap."
    return Finding(
        "stop" if timed and survey.lost.mean() > _MOST_LOST else "warn",  # names may be in any order
        f"{_some_show(survey.lost)} nothing of the next one{'' if timed else ', in the order of their names'}.",
        to_do if timed else f"{to_do} Without times, name photographs in the order of capture.",
        _named(survey, np.append(survey.lost, False)),
    )


def _lines(survey: Survey) -> Iterator[Finding]:
    """Look at what photographs share that were not taken one after the other."""
    if survey.ground is None or len(survey.photos) < 2 * _APART:
        return
    common = survey.ground.common
    known = np.isfinite(survey.ground.corners_m).all(axis=(1, 2))
    parts, part = connected_components(common >= _JOINED, directed=False)
    sizes = np.bincount(part[known], minlength=parts)
    if (sizes > 1).sum() > 1:
        small = known & (part != sizes.argmax())
        yield Finding(
            "warn",
            f"The flight falls into {(sizes > 1).sum()} parts that show hardly any common ground: one may be turned "
            "against the other, or be left out.",
            "Fly between them.",
            _named(survey, small),
        )
        return
    apart = common.tocoo()
    away = np.abs(apart.row - apart.col) >= _APART
    best = np.zeros(len(known))
    np.maximum.at(best, apart.row[away], apart.data[away])
    sideways = float(np.median(best[known])) if known.any() else 1.0
    if sideways < _WANTED_SIDEWAYS:
        yield Finding(
            "warn",
            f"Lines of the flight overlap sideways by {sideways:.0%} (median).",
            "Fly lines closer together: 60 % or more gives the ground between them depth from several sides.",
        )


def _gaps(survey: Survey) -> Iterator[Finding]:
    ground = survey.ground
    if ground is None or not ground.inside.any():
        return
    share = ground.gaps.sum() / ground.inside.sum()
    if share > _GAPS:
        yield Finding(
            "warn",
            f"{share:.0%} of the ground within the flight is seen by fewer than three photographs "
            f"({ground.gaps.sum() * ground.cell_m**2:,.0f} m2; red on the map).",
            "Fly these places again before you leave.",
        )


def _times(survey: Survey) -> Iterator[Finding]:
    times = [photo.exif.time for photo in survey.photos]
    known = [time for time in times if time is not None]
    if 0 < len(known) < len(times):
        yield Finding(
            "note",
            f"{_say(len(times) - len(known), 'photograph has', 'photographs have')} no time: the order is that of the names.",
            "Nothing.",
        )
        return
    flights = 1 + sum(after - before > _FLIGHTS_APART for before, after in pairwise(known))
    if flights > 1:
        days = len({time.date() for time in known})
        yield Finding(
            "warn" if days > 1 else "note",
            f"{flights} flights" + (f" on {days} days: light and things may have changed." if days > 1 else "."),
            "Nothing, if they show the same ground.",
        )


def _say(count: SupportsInt, one: str, more: str) -> str:
    """Say how many of what there are, in the singular for one."""
    return f"{int(count)} {one if int(count) == 1 else more}"


def _them(which: Bool[np.ndarray, " n"]) -> str:
    return "it" if which.sum() == 1 else "them"


def _some_show(which: Bool[np.ndarray, " m"]) -> str:
    """Say how many of the photographs that have a next one show something."""
    of = _say(len(which), "photograph", "photographs")
    return f"{which.sum()} of {of} {'shows' if which.sum() == 1 else 'show'}"


def _control(survey: Survey) -> Iterator[Finding]:
    listed = survey.control
    if listed is None:
        return
    if listed.problem:
        yield Finding("stop", f"{listed.problem}.", listed.remedy)
        return
    for note in listed.notes:
        yield Finding("note", f"{note}.", "Nothing, if that is meant.")
    control = _say(listed.control, "control point", "control points")
    check = _say(listed.check, "check point", "check points")
    told = f"{control} and {check} are marked in {LEAST_MARKS} photographs or more"
    if listed.control < LEAST_CONTROL:
        yield Finding("warn", f"{told}.", f"Mark {LEAST_CONTROL} control points or more: else GPS tells the world.")
    else:
        yield Finding("note", f"{told}: they tell the world, and not GPS.", "Nothing.")


_RULES: Sequence[Callable[[Survey], Iterator[Finding]]] = (
    _count, _unusable, _masks, _overlap, _lines, _gaps, _blur, _exposure, _positions, _cameras, _times, _control,
)  # fmt: skip
