"""Rules for the size of pictures. The reference is the size of the predicted views, which the user sets.

Most costs were measured on the built-in town at 640 px with views of 96 px (`docs/settings.png`). For poses, which are far
finer than a pixel of either, views of 256 px need little more; depth for them was measured again (`docs/trials.md`).
"""

from __future__ import annotations

from aug3d_core.factory.auto.decision import Known
from aug3d_core.run.stage import Decision

FEW_PHOTOS = 40  # with fewer, a lost photograph costs more than smaller photographs save in time
_PHOTO_OVER_VIEW = 3
_LEAST_PHOTO_PX = 576
_DEPTH_OVER_VIEW, _LEAST_DEPTH_PX = 2, 288
_LEAST_MOTION = 0.05  # of the width: along a flight line 20 photographs then see each point
_TEXELS_PER_PIXEL = 2.5  # domes may stand nearer than photographs did: sampling.min_sampling_ratio


def photo_px(known: Known) -> Decision:
    """Work on photographs a few times larger than the views; do not shrink a small set."""
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
        measured=f"predicted views are {width} px wide; the input is {from_them}",
        rule=f"{_PHOTO_OVER_VIEW} times the width of a view, at least {_LEAST_PHOTO_PX} px; with fewer than {FEW_PHOTOS}"
        f" photographs at least the preset's {preset} px",
        saves=f"{1 - share:.0%} of the pixels of photographs of {preset} px" if share < 1 else "",
        costs="on the town the position error rises from 0.0025 % to 0.004 % of the extent; at 480 px 3 of the 115 photographs"
        " of ochota could not be registered"
        if share < 1
        else "",
    )


def least_motion(known: Known) -> Decision | None:
    """Leave out photographs that repeat the one before them, unless the set is small."""
    photos = known.photos
    if photos is None or photos < FEW_PHOTOS:
        return None
    return Decision(
        field="photos.least_motion",
        value=_LEAST_MOTION,
        measured=f"{photos} photographs, each compared with the last one kept",
        rule=f"a photograph is left out if the picture moves by less than {_LEAST_MOTION:.0%} of its width, where 20 others see"
        f" each point; none is left out of fewer than {FEW_PHOTOS}",
    )


def first_octave(known: Known) -> Decision | None:
    """Search for features at the original size, not at twice the size, unless the set is small."""
    photos = known.photos
    if photos is None or photos < FEW_PHOTOS:
        return None
    return Decision(
        field="matching.first_octave",
        value=0,
        measured=f"{photos} photographs {known.photo_px} px wide",
        rule=f"0: the original size, which finds about one feature per 15 x 15 px; the preset's value with fewer than"
        f" {FEW_PHOTOS} photographs",
        saves="three quarters of the searched pixels and the smallest half of the features; two thirds of the time for poses on"
        " the town",
        costs="on the town the position error rises from 0.004 % to 0.016 % of the extent, a twentieth of a view's pixel",
    )


def depth_px(known: Known) -> Decision:
    """Make depth maps a few times wider than the views, never wider than the photographs."""
    preset, width = known.config.depth.max_px, known.config.dataset.width_px
    value = min(max(_DEPTH_OVER_VIEW * width, _LEAST_DEPTH_PX), known.photo_px)
    return Decision(
        field="depth.max_px",
        value=value,
        measured=f"views {width} px wide; photographs {known.photo_px} px wide",
        rule=f"{_DEPTH_OVER_VIEW} times the views' width, at least {_LEAST_DEPTH_PX} px, at most the width of the photographs",
        saves=f"{1 - (value / preset) ** 2:.0%} of the pixels of a depth map of {preset} px" if value < preset else "",
        costs="on the town the F-score of the mesh at 0.5 % of the extent fell from 0.973 to 0.944 with 256 instead of 512 px"
        if value < preset
        else "",
    )


def texel(known: Known) -> Decision:
    """Choose the size of a texel from the pixel of a view, however fine the photographs are."""
    preset, width = known.config.surface.texel_gsd, known.config.dataset.width_px
    value = round(max(preset, known.photo_over_view / _TEXELS_PER_PIXEL), 2)
    return Decision(
        field="surface.texel_gsd",
        value=value,
        measured=f"one of {width} pixels across a view covers {known.photo_over_view:.1f} pixels of a photograph",
        rule=f"{_TEXELS_PER_PIXEL} texels per pixel of a view, each at least {preset:g} pixels of a photograph",
        saves=f"{1 - (preset / value) ** 2:.0%} of the texels" if value > preset else "",
        costs="on the town the mesh at full size fell from 23.6 to 22.5 dB with 2 pixels per texel; views of this size do not"
        " show it"
        if value > preset
        else "",
    )


def view_width(known: Known) -> Decision:
    """Render views at the width of the data set."""
    return _as_packed("width_px", known.config.dataset.width_px)


def view_height(known: Known) -> Decision:
    """Render views at the height of the data set."""
    return _as_packed("height_px", known.config.dataset.height_px)


def _as_packed(field: str, px: int) -> Decision:
    return Decision(
        field=f"sampling.{field}",
        value=px,
        measured=f"views of the data set have {px} px",
        rule=f"equal to dataset.{field}: another size would be scaled to it",
    )
