"""How large pictures have to be: all is measured against the views that are to be predicted, whose size the user sets.

What the rules may cost was measured on the built-in town at 640 px, whose views have 96 px (`docs/settings.png`).
"""

from __future__ import annotations

from aug3d_core.grouping.config import MOST_K
from aug3d_core.needs.decision import Decision, Known

FEW_PHOTOS = 40  # below, a photograph lost costs more than the seconds that smaller ones save; and pairs are few
_PHOTO_OVER_VIEW = 6
_LEAST_PHOTO_PX = 576
_DEPTH_OVER_VIEW, _DEPTH_OVER_VIEW_ALONE = 3, 2
_LEAST_VIEW_PX = 96
_PLANE_STEP_PX = 4.0  # between planes depth is interpolated
_LEAST_MOTION = 0.05  # of the width: along a line of flight each point is then seen by 20 photographs already
_TEXELS_PER_PIXEL = 2.5  # domes may stand nearer than photographs did: sampling.min_sampling_ratio


def photo_px(known: Known) -> Decision:
    """Take photographs some times finer than the views; all there is of few."""
    preset, width = known.config.photos.max_px, known.config.dataset.width_px
    wanted = max(_PHOTO_OVER_VIEW * width, _LEAST_PHOTO_PX)
    photos = known.photos
    from_them = "photographs" if photos is None else f"{photos} photographs"
    few = photos is not None and photos < FEW_PHOTOS
    value = max(wanted, preset) if few else wanted
    share = (value / preset) ** 2
    return Decision(
        field="photos.max_px",
        value=value,
        measured=f"views of {width} px are to be predicted, from {from_them}",
        rule=f"{_PHOTO_OVER_VIEW} times the views' width, at least {_LEAST_PHOTO_PX} px; with fewer than {FEW_PHOTOS}"
        f" photographs not less than the preset's {preset} px",
        saves=f"{1 - share:.0%} of the pixels of photographs of {preset} px" if share < 1 else "",
        costs="the town's cameras are 0.004 % of its extent off in place of 0.0025 %; with 480 px 3 of ochota's 115"
        " photographs could not be placed any more"
        if share < 1
        else "",
    )


def least_motion(known: Known) -> Decision | None:
    """Leave out photographs that show what the one before them shows, unless there are few."""
    photos = known.photos
    if photos is None or photos < FEW_PHOTOS:
        return None
    return Decision(
        field="photos.least_motion",
        value=_LEAST_MOTION,
        measured=f"{photos} photographs, each compared with the last that is kept",
        rule=f"left out where the picture moves by less than {_LEAST_MOTION:.0%} of its width (20 others show each point then);"
        f" none of fewer than {FEW_PHOTOS}",
    )


def first_octave(known: Known) -> Decision | None:
    """Look for features in photographs as they are, not at twice their size, unless they are few."""
    photos = known.photos
    if photos is None or photos < FEW_PHOTOS:
        return None
    return Decision(
        field="matching.first_octave",
        value=0,
        measured=f"{photos} photographs of {known.photo_px} px",
        rule=f"0: as large as they are, which finds about one feature for each 15 x 15 px; as the preset with fewer than"
        f" {FEW_PHOTOS} photographs",
        saves="three quarters of the pixels that are searched, and the smallest half of the features; of the town's poses two"
        " thirds of the time",
        costs="the town's cameras are 0.016 % of its extent off in place of 0.004 %: a twentieth of a view's pixel",
    )


def depth_px(known: Known) -> Decision:
    """Make depth maps some times finer than the views, less so where nothing is rendered; never finer than the photographs."""
    preset, width, k = known.config.depth.max_px, known.config.dataset.width_px, known.figure("grouping", "k")
    times = _DEPTH_OVER_VIEW_ALONE if k == MOST_K else _DEPTH_OVER_VIEW
    least = times * _LEAST_VIEW_PX
    value = min(max(times * width, least), known.photo_px)
    why = f": from the mesh of groups of {MOST_K} nothing is rendered to learn from" if k == MOST_K else ""
    return Decision(
        field="depth.max_px",
        value=value,
        measured=f"views of {width} px; photographs of {known.photo_px} px; groups of {k or 0:.0f}",
        rule=f"{times} times the views' width, at least {least} px, at most the photographs'{why}",
        saves=f"{1 - (value / preset) ** 2:.0%} of the pixels whose depth is searched for at {preset} px"
        if value < preset
        else "",
        costs=_depth_costs(k == MOST_K) if value < preset else "",
    )


def _depth_costs(nothing_rendered: bool) -> str:
    if nothing_rendered:
        return "on the town 192 px in place of 288 took the mesh, seen from the test's cameras at 96 px, from 26.9 to 25.8 dB"
    return "on the town 256 px in place of 512 took the mesh's F-score at 0.5 % of extent from 0.973 to 0.944"


def plane_step(known: Known) -> Decision:
    """Search depth by planes that are further apart than the preset has them."""
    preset = known.config.depth.plane_step_px
    value = max(_PLANE_STEP_PX, preset)
    return Decision(
        field="depth.plane_step_px",
        value=value,
        measured="depth is interpolated between planes",
        rule=f"{_PLANE_STEP_PX:g} px of parallax from plane to plane",
        saves=f"{1 - preset / value:.0%} of the preset's planes" if value > preset else "",
        costs="with depth maps of 192 px the F-score of the town's mesh fell from 0.921 to 0.913, with 512 px by 0.0002"
        if value > preset
        else "",
    )


def texel(known: Known) -> Decision:
    """Let a texel be a part of a view's pixel, however fine the photographs are."""
    preset, width = known.config.surface.texel_gsd, known.config.dataset.width_px
    value = round(max(preset, known.photo_px / (_TEXELS_PER_PIXEL * width)), 2)
    return Decision(
        field="surface.texel_gsd",
        value=value,
        measured=f"a pixel of {width} across a view is as wide as {known.photo_px / width:.1f} of a photograph's",
        rule=f"{_TEXELS_PER_PIXEL} texels for each pixel of a view, none finer than {preset:g} of a photograph's",
        saves=f"{1 - (preset / value) ** 2:.0%} of the texels" if value > preset else "",
        costs="on the town 2 pixels a texel took the mesh seen at full size from 23.6 to 22.5 dB, which views so small"
        " do not show"
        if value > preset
        else "",
    )


def view_width(known: Known) -> Decision:
    """Render views as wide as they are packed."""
    return _as_packed("width_px", known.config.dataset.width_px)


def view_height(known: Known) -> Decision:
    """Render views as high as they are packed."""
    return _as_packed("height_px", known.config.dataset.height_px)


def _as_packed(field: str, px: int) -> Decision:
    return Decision(
        field=f"sampling.{field}",
        value=px,
        measured=f"the data set's views have {px} px",
        rule=f"as dataset.{field}: other sizes would be scaled to it",
    )
