"""What rendering decides by itself."""

from __future__ import annotations

from aug3d_core.rendering.probe import REFERENCE, Chosen
from aug3d_core.run.stage import Decision


def decision(chosen: Chosen) -> Decision:
    """Return the number of samples; if probe views were rendered, with what it reaches and saves."""
    reached = f"{chosen.psnr_db:.1f} dB on the worst of a few probe views" if chosen.psnr_db is not None else ""
    return Decision(
        field="rendering.samples",
        value=chosen.samples,
        measured=reached,
        rule=chosen.reason,
        saves=f"{1 - chosen.samples / REFERENCE:.0%} of the samples of {REFERENCE}" if reached else "",
    )
