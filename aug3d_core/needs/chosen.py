"""What stages decided by themselves, lifted from their records: a row per choice, with the reason that the stage gave."""

from __future__ import annotations

from collections.abc import Callable, Iterator

from aug3d_core.needs.decision import Decision
from aug3d_core.stage import Metric
from aug3d_core.store.record import Record

_PAIRS = {
    "exhaustive": "few photographs: all pairs are compared",
    "gps": "neighbours by GPS, which the photographs bear out",
    "gps and coarse": "neighbours by GPS, and by likeness for the photographs that do not bear it out",
    "coarse": "no GPS to go by: a coarse comparison of all pairs tells which look alike",
}
_UP = {"gps": "GPS altitudes fix the vertical well", "gravity": "from how the cameras hang and the ground lies"}
_REFERENCE_SAMPLES = 128  # per pixel, by the reason that rendering gives
_AS_SET = "as set"


def chosen_by(record: Record) -> Iterator[Decision]:
    """Yield what a stage chose, and what was set in its place; nothing of what its record does not tell."""
    yield from (told for told in _CHOICES.get(record.stage, _nothing)(record) if told.value is not None)


def _nothing(_: Record) -> Iterator[Decision]:
    yield from ()


def _photos(record: Record) -> Iterator[Decision]:
    m, least = record.metrics, _number(record.config.get("least_motion"))
    kept, redundant = _number(m.get("photos")), _number(m.get("redundant"))
    if not least or kept is None or redundant is None:
        return
    yield Decision(
        field="photos.worth_using",
        value=f"{kept:.0f} of {kept + redundant:.0f}",
        measured=f"{redundant:.0f} show what the one before them shows",
        rule=f"those whose picture moves by {least:.0%} of its width or more",
        saves=f"{redundant / (kept + redundant):.0%} of the photographs" if redundant else "",
    )


def _matching(record: Record) -> Iterator[Decision]:
    m = record.metrics
    tried, possible = _number(m.get("pairs_tried")), _number(m.get("pairs_possible"))
    if tried is None or not possible:
        return
    by = str(m.get("pairs_by"))
    yield Decision(
        field="matching.pairs",
        value=f"{tried:,.0f} of {possible:,.0f}, by {by}",
        measured=f"{m.get('photos')} photographs, {m.get('photos_doubted_gps') or 0} whose GPS they do not bear out",
        rule=_PAIRS.get(by, by),
        saves=f"{1 - tried / possible:.0%} of the comparisons" if tried < possible else "",
    )


def _sfm(record: Record) -> Iterator[Decision]:
    m = record.metrics
    if m.get("mapper"):
        reason = str(m.get("mapper_reason") or _AS_SET)
        yield Decision(field="sfm.mapper", value=m["mapper"], measured="", rule=reason)
    if m.get("camera_model"):
        yield Decision(
            field="sfm.camera_model",
            value=m["camera_model"],
            measured=_held_out(record),
            rule="the simplest whose error on held-out observations is near the best",
        )
    if m.get("focal_source"):
        focal, ratio = _number(m.get("focal_px")), _number(m.get("focal_exif_over_refined_error"))
        moved = 100 * (_number(m.get("focal_moved_share")) or 0.0)
        yield Decision(
            field="sfm.focal",
            value=m["focal_source"] if focal is None else f"{focal:,.1f} px, {m['focal_source']}",
            measured="photographs state none"
            if ratio is None
            else f"held-out error with that of EXIF is {ratio:.2f} times that with a fitted one, {moved:.2g} % off",
            rule="what photographs state, unless a fitted one gains half of what it moves, and 2 %",
        )
    if m.get("up_from"):
        up = str(m["up_from"])
        yield Decision(
            field="sfm.up", value=up, measured=_UP.get(up, up), rule="GPS where it is well spread, else gravity"
        )


def _held_out(record: Record) -> str:
    """Say how well each camera model predicts what it has not seen, with the focal length that was chosen."""
    source = record.metrics.get("focal_source")
    tried = {
        name.removeprefix("heldout_px_").removesuffix(f"_{source}"): _number(value)
        for name, value in record.metrics.items()
        if name.startswith("heldout_px_") and name.endswith(f"_{source}")
    }
    said = ", ".join(f"{name.upper()} {error:.3g}" for name, error in tried.items() if error is not None)
    return f"{said} px" if said else "nothing to tell it by: the simplest, or as given"


def _grouping(record: Record) -> Iterator[Decision]:
    m = record.metrics
    photos = f"{m.get('train_views')} training photographs"
    yield Decision(field="grouping.k", value=m.get("k"), measured=photos, rule=str(m.get("k_reason") or _AS_SET))
    gap, wanted = _number(m.get("gap_footprints")), record.config.get("gap_footprints")
    narrowed = next((note for note in record.notes if "gap" in note), f"{wanted} asked for")
    yield Decision(
        field="grouping.gap_footprints", value=None if gap is None else round(gap, 2), measured=narrowed,
        rule="as wide as leaves enough to train on",
    )  # fmt: skip
    told = _number(m.get("folds"))
    folds = None if told is None else int(told)
    small, enough = "a small scene is tested on all of it, block by block", "one test block holds enough photographs"
    tested = f"{m.get('target_views')} test photographs in this block"
    yield Decision(field="grouping.folds", value=folds, measured=tested, rule=small if folds != 1 else enough)


def _depth(record: Record) -> Iterator[Decision]:
    m = record.metrics
    reason = str(m.get("engine_reason") or _AS_SET)
    yield Decision(field="depth.engine", value=m.get("engine"), measured="what this machine can run", rule=reason)
    if m.get("planes_median"):
        measured = "the span of depths that sparse points show in each photograph"
        yield Decision(
            field="depth.planes", value=m["planes_median"], measured=measured, rule=str(m.get("planes_reason"))
        )


def _surface(record: Record) -> Iterator[Decision]:
    m = record.metrics
    chosen, reasons = ("octree_depth", "triangles", "texels"), str(m.get("needs") or "").split("; ")
    if len(reasons) != len(chosen):  # a sentence for each
        return
    spacing = _number(m.get("baseline_point_spacing_gsd"))
    measured = "" if spacing is None else f"points {spacing:.2f} of a photograph's pixels apart"
    for name, reason in zip(chosen, reasons, strict=True):
        full = _number(m.get(f"baseline_{name}_full"))
        value = m.get(f"baseline_{name}")
        saves = f"{full - (_number(value) or 0):,.0f} of {full:,.0f}" if full else ""
        told = "" if name == "texels" else measured
        yield Decision(field=f"surface.{name}", value=value, measured=told, rule=reason, saves=saves)


def _sampling(record: Record) -> Iterator[Decision]:
    m = record.metrics
    planned, uniform = _number(m.get("views_planned")), _number(m.get("uniform_views"))
    reach, even = _number(m.get("reach_share")), _number(m.get("uniform_reach_share"))
    by_coverage = record.config.get("choice") == "coverage" and reach is not None and even is not None
    yield Decision(
        field="sampling.views",
        value=m.get("views_planned"),
        measured=f"they reach {reach:.0%} of surface and directions, {uniform:.0f} by uniform sampling {even:.0%}"
        if by_coverage and uniform
        else "as many as found a place",
        rule=f"the rest adds too little (sampling.min_gain {record.config.get('min_gain')})"
        if by_coverage
        else _AS_SET,
        saves=f"{uniform - planned:.0f} of {uniform:.0f} views" if planned and uniform and uniform > planned else "",
    )
    finest, coarsest = _number(m.get("cell_finest_world_units")), _number(m.get("cell_coarsest_world_units"))
    if finest is not None and coarsest is not None:
        coarser = _number(m.get("sampling_over_finest_ratio")) or 0.0
        yield Decision(
            field="sampling.scales",
            value=f"{finest:,.1f} to {coarsest:,.1f} across",
            measured=f"views are {coarser:.2f} times as coarse as photographs justify",
            rule="no finer than the photographs, no coarser than the scene",
        )


def _rendering(record: Record) -> Iterator[Decision]:
    m = record.metrics
    samples, psnr_db = _number(m.get("samples")), _number(m.get("samples_psnr_db"))
    if samples:
        reached = f"{psnr_db:.1f} dB on the worst of a few probe views" if psnr_db is not None else ""
        saves = f"{1 - samples / _REFERENCE_SAMPLES:.0%} of the samples of {_REFERENCE_SAMPLES}" if reached else ""
        yield Decision(
            field="rendering.samples",
            value=m["samples"],
            measured=reached,
            rule=str(m.get("samples_reason")),
            saves=saves,
        )


def _training(record: Record) -> Iterator[Decision]:
    m, wanted = record.metrics, record.config.get("steps")
    all_of_them = m.get("stopped_by") == "steps"
    yield Decision(
        field="training.steps_made",
        value=m.get("steps"),
        measured=f"{wanted} asked for",
        rule="all of them were worth it" if all_of_them else "no more gain on fixed rays of training groups",
        saves="" if all_of_them else f"{int(wanted or 0) - int(_number(m.get('steps')) or 0)} steps",
    )
    asked = f"{record.config.get('encoder_weights')} asked for"
    yield Decision(field="training.encoder_from", value=m.get("encoder_from"), measured=asked, rule="what is at hand")


def _number(value: Metric) -> float | None:
    return float(value) if isinstance(value, int | float) else None


_CHOICES: dict[str, Callable[[Record], Iterator[Decision]]] = {
    "photos": _photos,
    "matching": _matching,
    "sfm": _sfm,
    "grouping": _grouping,
    "depth": _depth,
    "surface": _surface,
    "sampling": _sampling,
    "rendering": _rendering,
    "training": _training,
}
