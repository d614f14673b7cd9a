"""How many virtual views there are, and whether training looks at them."""

from __future__ import annotations

import math

from aug3d_core.needs.decision import Decision, Known

# A mesh is believed where it shows the photographs that it was made of at least so well (dB) and so wholly (share). The town's
# has 33 dB and 0.95, ochota's 26 and 0.90, those of brighton's folds 24 to 25 and 0.62 to 0.79.
LEAST_PSNR_DB = 20.0
LEAST_COVERED = 0.5


def domes(known: Known) -> Decision | None:
    """Plan as many virtual views as there are training photographs, none where the mesh is not to be believed."""
    photos, k = known.training_photos, known.figure("grouping", "k")
    if photos is None or not k:
        return None
    count, own = photos
    preset = known.config.sampling.domes
    members = known.config.sampling.views_per_dome or int(k)  # fewer than K are refused: a dome is packed as a group
    believed = _believed(known)
    value = math.ceil(own / members) if believed else 1
    return Decision(
        field="sampling.domes",
        value=value,
        measured=f"{own} of {count} training photographs show something of their own; {members} views a dome; {_told(known)}",
        rule="as many virtual views as such photographs"
        if believed
        else f"one dome, which training does not look at: below {LEAST_PSNR_DB:g} dB or {LEAST_COVERED:.0%} covered",
        saves=f"{preset - value} of the preset's {preset} domes" if value < preset else "",
        costs="less of the surface is seen from new directions" if value < preset else "",
    )


def rendered_share(known: Known) -> Decision | None:
    """Leave renders of a mesh that is not to be believed out of training."""
    preset = known.config.training.rendered_share
    if known.figure("surface", "render_psnr") is None:
        return None
    rendered, real = (known.figure("dataset", name) or 0 for name in ("groups_rendered", "groups_real"))
    value = preset if _believed(known) and rendered else 0.0
    return Decision(
        field="training.rendered_share",
        value=value,
        measured=f"{_told(known)}; {rendered:.0f} groups of renders, {real:.0f} of photographs",
        rule=f"{preset:g}, as the preset, where the mesh shows its own photographs with {LEAST_PSNR_DB:g} dB and covers"
        f" {LEAST_COVERED:.0%}; else nothing is learned from renders",
        costs="" if value else "the directions that photographs do not have",
    )


def _believed(known: Known) -> bool:
    psnr_db, covered = (known.figure("surface", name) for name in ("render_psnr", "covered_share"))
    return (psnr_db or 0.0) >= LEAST_PSNR_DB and (covered or 0.0) >= LEAST_COVERED


def _told(known: Known) -> str:
    psnr_db, covered = (known.figure("surface", name) or 0.0 for name in ("render_psnr", "covered_share"))
    return f"the mesh shows its own photographs with {psnr_db:.1f} dB and covers {covered:.0%} of them"
