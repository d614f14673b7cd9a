"""The traffic lights: the main checks of a scene, each with its bounds."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from html import escape
from typing import Literal

from aug3d_core.judging.names import called
from aug3d_core.judging.summary import FROM_MESH
from aug3d_core.report.html import number, percent, tag
from aug3d_core.report.reported_run import ReportedRun
from aug3d_core.report.sections.control import surveyed
from aug3d_core.report.sections.remedies import remedy
from aug3d_core.report.sections.tracks import ENOUGH

Light = Literal["good", "check", "bad"]
MAP, VIEWS, MODEL = (
    "a map and a mesh",
    "views from new places",
    "the model rather than a simpler answer",
)  # uses of a scene
_GOOD_DB, _BAD_DB = 25.0, 20.0  # a pixel is off by an 18th and by a tenth of full brightness


@dataclass(frozen=True)
class Verdict:
    """One check: its subject, its light, the figure, and the bounds of good and bad.

    use: what the scene is not good for if the light is not good. to_do: what then helps.
    """

    what: str
    light: Light
    figure: str
    bounds: str
    use: str
    to_do: str


def verdicts(run: ReportedRun) -> tuple[Verdict, ...]:
    """Return the checks that apply to a run."""
    return (*_geometry(run), *_test(run))


def lights(judged: tuple[Verdict, ...]) -> str:
    """Return the lights as a list; each shows a word beside its colour."""
    rows = "".join(
        tag(
            "li",
            tag("span", one.light, class_=f"light {one.light}")
            + tag("b", escape(one.what))
            + tag("span", escape(one.figure), class_="says")
            + tag("small", escape(one.bounds)),
        )
        for one in judged
    )
    return tag("ul", rows, class_="lights card") if rows else ""


def _least(value: float, good: float, bad: float) -> Light:
    """Judge a figure where more is better."""
    return "good" if value >= good else "check" if value >= bad else "bad"


def _most(value: float, good: float, bad: float) -> Light:
    """Judge a figure where less is better."""
    return "good" if value <= good else "check" if value <= bad else "bad"


def _of_folds(run: ReportedRun, stage: str, name: str) -> list[float]:
    """Return a figure of every fold that has it. The worst is judged: one bad fold is enough to spoil a test."""
    figures = (run.in_fold(fold).figure(stage, name) for fold in range(run.folds))
    return [figure for figure in figures if figure is not None]


def _bounds(good: str, bad: str, of: list[float], least: bool = False) -> str:
    bounds = f"good from {good}, bad below {bad}" if least else f"good to {good}, bad above {bad}"
    return f"{bounds}; worst of {len(of)} folds" if len(of) > 1 else bounds


def _geometry(run: ReportedRun) -> Iterator[Verdict]:
    placed = run.figure("sfm", "registered_share")
    if placed is not None:
        figure = f"{number(run.metric('sfm', 'registered'))} of {number(run.metric('sfm', 'photos'))}"
        light, bounds = _least(placed, 0.95, 0.75), "good from 95 %, bad below 75 %"
        yield Verdict("photographs with a pose", light, figure, bounds, MAP, remedy("pose", run))
    error_px = run.figure("sfm", "reprojection_px")
    if error_px is not None:
        light, bounds = _most(error_px, 1, 2), "good to 1 px, bad above 2"
        yield Verdict("reprojection error", light, f"{error_px:.2f} px", bounds, MAP, remedy("error", run))
    gps_m = run.figure("sfm", "gps_residual_m_median")
    if gps_m is not None:
        light, bounds = _most(gps_m, 5, 15), "good to 5 m, bad above 15"
        yield Verdict("GPS error, median", light, f"{gps_m:.1f} m", bounds, MAP, remedy("gps", run))
    elif run.record("sfm") and surveyed(run).empty:
        yield Verdict("GPS", "check", "not used", "without it, lengths are nominal", MAP, remedy("no gps", run))
    if run.seen_by is not None and (run.seen_by >= 0).any():
        share = float((run.seen_by[run.seen_by >= 0] >= ENOUGH).mean())
        what = f"ground seen by {ENOUGH} or more photographs"
        light, bounds = _least(share, 0.8, 0.5), "good from 80 %, bad below 50 %"
        yield Verdict(what, light, percent(share), bounds, MAP, remedy("ground", run))
    bad = _of_folds(run, "overlap", "bad_members_share")
    if bad:
        light, bounds = _most(max(bad), 0.01, 0.2), _bounds("1 %", "20 %", bad)
        yield Verdict("bad group members", light, percent(max(bad), 1), bounds, VIEWS, remedy("groups", run))
    seen = _of_folds(run, "surface", "target_covered_share_full")
    if seen:
        what, bounds = "held-out photographs: share covered by the mesh", _bounds("90 %", "60 %", seen, least=True)
        yield Verdict(what, _least(min(seen), 0.9, 0.6), percent(min(seen)), bounds, MAP, remedy("holes", run))
    error_pct = run.figure("truth", "position_error_pct")
    if error_pct is not None:
        what, bounds = (
            "camera position error against ground truth",
            "median, relative to the extent; good to 0.1 %, bad above 1 %",
        )
        yield Verdict(what, _most(error_pct, 0.1, 1), f"{error_pct:.3f} %", bounds, MAP, remedy("error", run))


def _test(run: ReportedRun) -> Iterator[Verdict]:
    kept = _of_folds(run, "rendering", "kept_share")
    if kept:
        bounds = _bounds("90 %", "50 %", kept, least=True)
        light = _least(min(kept), 0.9, 0.5)
        yield Verdict("rendered views kept", light, percent(min(kept)), bounds, VIEWS, remedy("renders", run))
    audits = [run.in_fold(fold).metric("dataset", "leak_audit") for fold in range(run.folds)]
    found = [str(audit) for audit in audits if audit]
    if found:
        light = "good" if set(found) == {"pass"} else "check" if set(found) <= {"pass", "doubtful"} else "bad"
        figure = ", ".join(dict.fromkeys(found))
        yield Verdict("leak audit", light, figure, "good if every check passes", VIEWS, remedy("leaks", run))
    nvs = run.metrics.get("nvs")
    if nvs:
        psnr_db = nvs["test_psnr_mean"]
        light, figure = _least(psnr_db, _GOOD_DB, _BAD_DB), f"{psnr_db:.1f} dB"
        bounds = f"good from {_GOOD_DB:g} dB ({off_words(_GOOD_DB)}), bad below {_BAD_DB:g} dB ({off_words(_BAD_DB)})"
        yield Verdict("held-out photographs, predicted", light, figure, bounds, VIEWS, remedy("views", run))
    if nvs and any(value is not None for value in nvs["cheap"].values()):
        cheap = {name: value for name, value in nvs["cheap"].items() if value is not None}
        yield _against_cheap(run, cheap)


def _against_cheap(run: ReportedRun, cheap: Mapping[str, float]) -> Verdict:
    """Compare the model with the cheap answers. Those of the mesh were made from more than the model's inputs."""
    model = run.metrics["nvs"]["test_psnr_mean"]
    best = max(cheap, key=lambda name: cheap[name])
    from_inputs = max((value for name, value in cheap.items() if name not in FROM_MESH), default=-float("inf"))
    ends = run.metrics["nvs"]["over_ci"][best]
    light: Light = "good" if ends and ends[0] > 0 else "check" if model >= from_inputs else "bad"
    what = f"model against the best cheap answer ({called(best)})"
    bounds = (
        "good if the 95 % interval, paired over photographs, is above zero; bad below those made from the same inputs"
    )
    interval = f" ({ends[0]:+.2f} to {ends[1]:+.2f})" if ends else ""
    to_do = remedy("simpler" if ends and ends[1] < 0 else "undecided", run)
    return Verdict(what, light, f"{model - cheap[best]:+.2f} dB{interval}", bounds, MODEL, to_do)


def off_words(psnr_db: float) -> str:
    """Return by how much a pixel is off, root mean square, as people read it."""
    return f"pixels {percent(10 ** (-psnr_db / 20))} of full brightness off"
