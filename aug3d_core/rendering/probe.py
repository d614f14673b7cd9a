"""Choose the number of samples: the fewest with which probe views reach 38 dB against the same views with many samples.

Under emission the only error of a sample is its position in the pixel: it shows at edges and in fine texture. How much there
is of both depends on the scene and on the size of a pixel, so no fixed number is right for all.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from jaxtyping import Float, UInt8

from aug3d_core.rendering.job import RenderJob, Shard
from aug3d_core.rendering.launch import render

ENOUGH_DB = 38.0
_VIEWS = 4
_CANDIDATES = (1, 2, 4, 6, 8, 10, 12, 16, 24, 32, 48)
REFERENCE = 128  # its own error, 54 dB on the town, takes 0.1 dB from what is measured
_SEED = 1  # the reference's, so that it does not hold the candidates' own samples


@dataclass(frozen=True)
class Chosen:
    """A number of samples, its PSNR on the worst probe view, and the reason for it."""

    samples: int
    psnr_db: float | None
    reason: str


def choose_samples(job: RenderJob, cameras: Mapping[str, np.ndarray], scratch: Path) -> Chosen:
    """Render probe views of a job's plan in one worker and choose; `scratch` is a temporary folder."""
    views = len(cameras["view_id"])
    chosen = np.unique(np.linspace(0, views - 1, min(views, 2 * _VIEWS + 1)).astype(int)[1::2]) if views > 1 else [0]
    np.savez(scratch / "cameras.npz", **{name: array[chosen] for name, array in cameras.items()})
    shards = [
        Shard(first=0, last=len(chosen), out=scratch / f"{samples}.npz", samples=samples) for samples in _CANDIDATES
    ]
    reference = Shard(first=0, last=len(chosen), out=scratch / "reference.npz", samples=REFERENCE, seed=_SEED)
    probe = {"cameras": scratch / "cameras.npz", "shards": (*shards, reference), "depth": False}
    render(job.model_copy(update=probe), lambda _: None)
    truth = _load(reference.out)
    return pick({shard.samples: float(psnr_db(_load(shard.out), truth).min()) for shard in shards})


def pick(psnr_by_samples: Mapping[int, float]) -> Chosen:
    """Return the fewest samples that are enough, or the largest candidate."""
    enough = [samples for samples, psnr in psnr_by_samples.items() if psnr >= ENOUGH_DB]
    if not enough:
        most = max(psnr_by_samples)
        reason = f"even {most} samples stay below {ENOUGH_DB:g} dB to {REFERENCE} on a probe view"
        return Chosen(most, psnr_by_samples[most], reason)
    fewest = min(enough)
    return Chosen(
        fewest, psnr_by_samples[fewest], f"the fewest with {ENOUGH_DB:g} dB to {REFERENCE} on every probe view"
    )


Pixels = tuple[UInt8[np.ndarray, "n h w 3"], UInt8[np.ndarray, "n h w"]]  # colour, alpha


def psnr_db(candidate: Pixels, reference: Pixels) -> Float[np.ndarray, " n"]:
    """Return each view's PSNR in colour times alpha, over the pixels that either shows something in; inf where alike."""
    (rgb, alpha), (true_rgb, true_alpha) = candidate, reference
    off = rgb * (alpha / 255.0)[..., None] - true_rgb * (true_alpha / 255.0)[..., None]
    seen = ((alpha > 0) | (true_alpha > 0)).sum(axis=(1, 2))
    error = (off**2).sum(axis=(1, 2, 3)) / np.maximum(3 * seen, 1)
    with np.errstate(divide="ignore"):
        return 10 * np.log10(255.0**2 / error)


def _load(path: Path) -> Pixels:
    with np.load(path, allow_pickle=False) as shard:
        return shard["rgb"], shard["alpha"]
