"""The answer, for people who read nothing else: is it good enough, where not, and what to do.

All of it follows from the checks of `verdicts`. A use of the scene is as good as the worst check that it hangs on; what to do
is what helps the checks that are not good, the bad ones first.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from html import escape
from typing import Any

import numpy as np
from jaxtyping import Bool

from aug3d_core.judging.names import called
from aug3d_core.report.html import percent, tag
from aug3d_core.report.reported_run import ReportedRun
from aug3d_core.report.sections.answers import pair, tested
from aug3d_core.report.sections.remedies import as_html
from aug3d_core.report.sections.tracks import ENOUGH
from aug3d_core.report.sections.verdicts import MAP, VIEWS, Light, Verdict, off_words, verdicts

_WORDS: Mapping[Light, str] = {"good": "yes", "check": "with care", "bad": "no"}
_SAID: Mapping[Light, str] = {"good": "Good enough for", "check": "With care for", "bad": "Not good enough for"}
_WORST_FIRST: Sequence[Light] = ("bad", "check", "good")
_ROWS, _COLUMNS = ("north", "", "south"), ("west", "", "east")
_ON_THE_MAP = {"north": "upper", "south": "lower", "west": "left", "east": "right"}  # where north is not known
_RULE = (
    "Each use is as good as the worst of its checks (Summary, with bounds): yes if all are good, with care if one is to be"
    " checked, no if one is bad. Which pictures to use follows from the 95 % interval of the difference in PSNR, paired over"
    " held-out photographs: nothing is decided where it contains zero."
)
_NOTHING_TO_DO = "Nothing has to be done. `aug3d predict {0}` makes views, `aug3d export {0} DIR --format map` a map."


def answer(run: ReportedRun) -> str:
    """Return the answer; empty where nothing was measured."""
    judged = verdicts(run)
    if not judged:
        return ""
    uses = {use: found for use in (MAP, VIEWS) if (found := [one for one in judged if one.use == use])}
    lead = _lead(uses, "failure" in run.metrics)
    rows = "".join(_use(use, of_use) for use, of_use in uses.items()) + _pictures(run.metrics.get("nvs"))
    where = list(_where(run))
    parts = (
        tag("p", lead, class_="lead") + tag("ul", rows, class_="lights"),
        tag("h3", "Where not?") + _listed("ul", where, "Nowhere that was measured."),
        tag("h3", "What to do")
        + _listed("ol", _to_do(run, judged), as_html(_NOTHING_TO_DO.format(run.metrics["scene"]))),
        tag("details", tag("summary", "How this is decided") + tag("p", _RULE, class_="dim")),
    )
    return tag("div", "".join(parts), class_="card answer")


def worst(judged: Sequence[Verdict]) -> Light:
    """Return the worst light."""
    return next(light for light in _WORST_FIRST if any(one.light == light for one in judged))


def _lead(uses: Mapping[str, Sequence[Verdict]], failed: bool) -> str:
    """Say in a sentence for each light what the scene is good for."""
    by_light: dict[Light, list[str]] = {}
    for use, judged in uses.items():
        by_light.setdefault(worst(judged), []).append(use)
    said = [
        f"{_SAID[light]} {' and for '.join(by_light[light])}."
        for light in ("good", "check", "bad")
        if light in by_light
    ]
    return " ".join(["The run stopped before its end.", *said] if failed else said)


def _use(use: str, judged: Sequence[Verdict]) -> str:
    """Return a use with its light: what holds it back, else what was measured."""
    light = worst(judged)
    against = [one for one in judged if one.light != "good"]
    figures = ", ".join(f"{one.what}: {one.figure}" for one in against or judged)
    return _line(light, _WORDS[light], use[0].upper() + use[1:], f"held back by {figures}" if against else figures)


def _line(light: Light, word: str, what: str, why: str) -> str:
    return tag("li", tag("span", word, class_=f"light {light}") + tag("b", escape(what)) + tag("small", escape(why)))


def _pictures(nvs: Mapping[str, Any] | None) -> str:
    """Say which pictures to use: those of the model, or the best answer without learning."""
    cheap = {name: value for name, value in nvs["cheap"].items() if value is not None} if nvs else {}
    if nvs is None or not cheap:
        return ""
    best = max(cheap, key=lambda name: cheap[name])
    ends, over, name = nvs["over_ci"][best], nvs["test_psnr_mean"] - cheap[best], called(best)
    why = f"{over:+.2f} dB over the best answer without learning, {name}"
    if ends is None:
        return _line("check", "open", f"The model or {name}", f"{why}: one held-out photograph decides nothing")
    why += f" (95 % interval {ends[0]:+.2f} to {ends[1]:+.2f})"
    if ends[0] > 0:
        return _line("good", "use", "The model", why)
    if ends[1] < 0:
        return _line("bad", "use", f"{name[0].upper()}{name[1:]}, not the model", why)
    return _line("check", "open", f"The model or {name}: neither is surely better", why)


def _where(run: ReportedRun) -> Iterator[str]:
    """Yield what is not good enough where, as HTML."""
    if run.seen_by is not None and (thin := (run.seen_by >= 0) & (run.seen_by < ENOUGH)).any():
        said = thin_words(thin, run.seen_by >= 0, run.enclosed, run.unit == "m")
        told = tag("code", f"aug3d advise {escape(run.metrics['scene'])} DIR")
        yield f"{said} {tag('a', 'See the map.', href='#overlap')} {told} says what to photograph next within the flight."
    placed, photos = run.metric("sfm", "registered"), run.metric("sfm", "photos")
    if isinstance(placed, int) and isinstance(photos, int) and placed < photos:
        verb = "has" if photos - placed == 1 else "have"
        yield f"{photos - placed} of {photos} photographs {verb} no pose. " + tag("a", "See which.", href="#cameras")
    views = tested(run)
    if len(views):
        low = views.sort_values("psnr").iloc[0]
        photo_id, psnr_db = int(low["photo_id"]), float(low["psnr"])
        named = f"{escape(run.names[photo_id])} (number {photo_id})" if photo_id in run.names else f"number {photo_id}"
        said = (
            f"Of the {len(views)} held-out photographs, {named} is predicted worst"
            if len(views) > 1
            else f"The one held-out photograph, {named}, is predicted"
        )
        yield (
            f"{said}: {psnr_db:.1f} dB, {off_words(psnr_db)}. "
            + tag("a", "See all.", href="#test")
            + pair(run, photo_id, int(low["fold"]), psnr_db)
        )


def thin_words(
    thin: Bool[np.ndarray, "h w"], known: Bool[np.ndarray, "h w"], inside: Bool[np.ndarray, "h w"], compass: bool
) -> str:
    """Say how much ground few photographs see, whether most of it is beyond the flight, and in which ninth of the map.

    thin: pieces that few see, row 0 in the north. known: mapped pieces. inside: those that the flight encloses.
    """
    beyond = (thin & ~inside).sum() > (thin & inside).sum()
    most = thin & (~inside if beyond else inside)
    ninths = {
        (row, column): most[np.ix_(rows, columns)].sum()
        for row, rows in zip(_ROWS, np.array_split(np.arange(thin.shape[0]), 3), strict=True)
        for column, columns in zip(_COLUMNS, np.array_split(np.arange(thin.shape[1]), 3), strict=True)
    }
    named = [word if compass else _ON_THE_MAP[word] for word in max(ninths, key=lambda ninth: ninths[ninth]) if word]
    place = (
        "in the middle"
        if not named
        else f"in the {'-'.join(named)}"
        if compass
        else f"at the {' '.join(named)} of the map"
    )
    said = f"{percent(float(thin.sum() / known.sum()))} of the mapped ground is in fewer than {ENOUGH} photographs, most of it"
    if beyond:
        return f"{said} beyond the edge of the flight, above all {place}: fly further out there if you need it."
    return f"{said} within the flight, above all {place}."


def _to_do(run: ReportedRun, judged: Sequence[Verdict]) -> list[str]:
    """Return what to do as HTML: why a run stopped first, then the bad checks, then those that are to be looked at."""
    stopped = [escape(run.metrics["failure"]["remedy"])] if "failure" in run.metrics else []
    ordered = [one for light in _WORST_FIRST[:2] for one in judged if one.light == light]
    return [*stopped, *dict.fromkeys(f"{tag('b', escape(one.what))}: {as_html(one.to_do)}" for one in ordered)]


def _listed(kind: str, items: Sequence[str], none: str) -> str:
    return tag(kind, "".join(tag("li", item) for item in items)) if items else tag("p", none)
