"""How many virtual views there are, whether training looks at them, and from how many photographs a view is predicted."""

from __future__ import annotations

import math

from aug3d_core.factory.auto.decision import Known
from aug3d_core.groups.config import MOST_K
from aug3d_core.run.stage import Decision

# A mesh is believed where it shows the photographs that it was made of at least so well (dB) and so wholly (share). The town's
# has 33 dB and 0.95, ochota's 26 and 0.90, those of brighton's folds 24 to 25 and 0.62 to 0.79.
LEAST_PSNR_DB = 20.0
LEAST_COVERED = 0.5
_GIVEN_OVER_TRAINED = 2  # views that a network is given, over those that it was trained with


def domes(known: Known) -> Decision | None:
    """Plan as many virtual views as there are training photographs, none where nothing would be learned from them."""
    photos, k = known.training_photos, known.figure("grouping", "k")
    if photos is None or not k:
        return None
    preset = known.config.sampling.domes
    members = known.config.sampling.views_per_dome or int(k)  # fewer than K are refused: a dome is packed as a group
    why_none = _why_none(known)
    value = 0 if why_none else math.ceil(photos / members)
    return Decision(
        field="sampling.domes",
        value=value,
        measured=f"{photos} photographs are worth training on; {members} views a dome; {_told(known)}",
        rule=f"none: {why_none}" if why_none else "as many virtual views as such photographs",
        saves=f"{preset - value} of the preset's {preset} domes" if value < preset else "",
        costs="less of the surface is seen from new directions" if value < preset else "",
    )


def rendered_share(known: Known) -> Decision | None:
    """Leave renders out of training where nothing would be learned from them."""
    preset = known.config.training.rendered_share
    if known.figure("surface", "render_psnr") is None:
        return None
    rendered, real = (known.figure("dataset", name) or 0 for name in ("groups_rendered", "groups_real"))
    why_none = _why_none(known) or ("" if rendered else "there are none")
    value = 0.0 if why_none else preset
    return Decision(
        field="training.rendered_share",
        value=value,
        measured=f"{_told(known)}; {rendered:.0f} groups of renders, {real:.0f} of photographs",
        rule=f"nothing is learned from renders: {why_none}" if why_none else f"{preset:g}, as the preset",
        costs="the directions that photographs do not have" if why_none else "",
    )


def input_views(known: Known) -> Decision | None:
    """Predict from more photographs than the network was trained with: what one does not show, another does."""
    there, trained = support_photos(known), known.config.training.input_views
    if there is None:
        return None
    return Decision(
        field="evaluation.input_views",
        value=min(_GIVEN_OVER_TRAINED * trained, there),
        measured=f"{there} photographs for each that is held out; the network was trained with {trained} at a time",
        rule=f"{_GIVEN_OVER_TRAINED} times as many as it was trained with, as far as there are so many",
        costs="about 1.7 times the time of a view; from 3, 6 and 9 photographs the town's have 22.6, 22.8 and 22.8 dB, ochota's"
        " 22.9, 23.6 and 23.6",
    )


def support_photos(known: Known) -> int | None:
    """Return from how many photographs a held-out one can be predicted, None where there are none yet."""
    k, support = known.figure("grouping", "k"), known.figure("grouping", "support_views")
    return int(min(k - 1, support)) if k and support else None


def _why_none(known: Known) -> str:
    """Return why virtual views are not worth their time, "" where they are.

    Groups of ten photographs that overlap gained nothing by them on ochota (+0.03 dB [-0.30, 0.37] over three seeds), groups
    of 20 did (+0.64 [0.04, 1.36]; `aug3d study augmentation`). Smaller groups are of photographs that overlap little.
    """
    psnr_db, covered = (known.figure("surface", name) for name in ("render_psnr", "covered_share"))
    if (psnr_db or 0.0) < LEAST_PSNR_DB or (covered or 0.0) < LEAST_COVERED:
        return f"the mesh is below {LEAST_PSNR_DB:g} dB or {LEAST_COVERED:.0%} covered"
    if known.figure("grouping", "k") == MOST_K:
        return f"photographs overlap enough for groups of {MOST_K}, to which renders add nothing"
    return ""


def _told(known: Known) -> str:
    psnr_db, covered = (known.figure("surface", name) or 0.0 for name in ("render_psnr", "covered_share"))
    k = known.figure("grouping", "k") or 0
    return (
        f"groups of {k:.0f}; the mesh shows its own photographs with {psnr_db:.1f} dB and covers {covered:.0%} of them"
    )
