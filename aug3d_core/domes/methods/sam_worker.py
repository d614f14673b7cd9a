"""The Segment Anything process: `python -m aug3d_core.domes.methods.sam_worker job.json` outlines a picture and ends.

The model is asked for the outline at each point of a grid, at three sizes each; what it is sure of and what hardly
depends on the threshold is kept, with the thresholds of its authors' automatic masks. Weights are read from safetensors
alone. If they cannot be read, the reason is reported as a line, and nothing is written.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import torch
from jaxtyping import Bool, Float, UInt8
from torch.nn.functional import interpolate
from transformers import SamModel

from aug3d_core.domes.methods.sam_job import SamJob
from aug3d_core.run.helper_process import begin

GRID = 32  # points along each side
BATCH = 16  # points at a time
SURE = 0.88  # least overlap with the true outline that the model expects of its own
STABLE, OFFSET = 0.95, 1.0  # least overlap of the outlines at logits of plus and minus the offset
MOSTLY = 0.75  # least share of an outline that is built
MEAN, DEVIATION = (123.675, 116.28, 103.53), (58.395, 57.12, 57.375)  # of the pictures that it was trained on


class UnusableWeights(Exception):
    """The weights cannot be loaded; says why."""


def load(weights: str, on_disk: bool) -> SamModel:
    """Return the model. Raises UnusableWeights where there is none, or that of something else."""
    try:
        loaded: Any = SamModel.from_pretrained(
            weights, use_safetensors=True, local_files_only=on_disk, output_loading_info=True
        )
    except Exception as error:  # the library raises what its parts raise: OSError, ValueError, RuntimeError, its own
        raise UnusableWeights(" ".join(str(error).split()) or type(error).__name__) from error
    model, told = loaded
    if told["missing_keys"]:
        raise UnusableWeights(f"they lack {sorted(told['missing_keys'])[0]}: they are not of a Segment Anything model")
    return model.eval()


@torch.inference_mode()
def outline(
    model: SamModel, rgb: UInt8[np.ndarray, "h w 3"], built: Bool[np.ndarray, "h w"]
) -> Bool[np.ndarray, "h w"]:
    """Return the union of the outlines that are mostly built."""
    side, size = int(model.config.to_dict()["vision_config"]["image_size"]), np.array(rgb.shape[:2])
    inner = np.maximum(np.rint(size * side / size.max()), 1).astype(int)  # of the square that the model sees
    seen = model.get_image_embeddings(_prepared(rgb, inner, side))
    points = torch.from_numpy(_grid(inner))
    target, union = torch.from_numpy(built), torch.zeros(built.shape, dtype=torch.bool)
    for some in points.split(BATCH):
        answer = model(image_embeddings=seen, input_points=some[None, :, None], multimask_output=True)
        logits, sure = answer.pred_masks[0].flatten(0, 1), answer.iou_scores[0].flatten()
        if not (sure >= SURE).any():
            continue
        rows, columns = np.ceil(inner * logits.shape[-1] / side).astype(int)
        logits = interpolate(logits[sure >= SURE][None, :, :rows, :columns], tuple(size), mode="bilinear")[0]
        masks = logits > 0
        stable = _count(logits > OFFSET) >= STABLE * _count(logits > -OFFSET)
        good = stable & (_count(masks) > 0) & (_count(masks & target) >= MOSTLY * _count(masks))
        union |= masks[good].any(dim=0)
    return union.numpy()


def _prepared(rgb: UInt8[np.ndarray, "h w 3"], inner: np.ndarray, side: int) -> torch.Tensor:
    """Return the picture as the model expects it: its longer side fills a square, the rest of which is zero."""
    picture = torch.from_numpy(rgb.copy()).permute(2, 0, 1)[None].float()
    picture = interpolate(picture, tuple(inner), mode="bilinear", antialias=True)
    mean, deviation = (torch.tensor(values).reshape(1, 3, 1, 1) for values in (MEAN, DEVIATION))
    square = torch.zeros(1, 3, side, side)
    square[:, :, : inner[0], : inner[1]] = (picture - mean) / deviation
    return square


def _grid(inner: np.ndarray) -> Float[np.ndarray, "p 2"]:
    """Return points (x, y) in the middle of equal cells."""
    y, x = ((np.arange(GRID) + 0.5) / GRID * count for count in inner)
    return np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2).astype(np.float32)


def _count(masks: torch.Tensor) -> torch.Tensor:
    return masks.flatten(1).sum(dim=1)


def main() -> None:
    """Outline the picture of the job named on the command line."""
    job, report = begin(SamJob)
    try:
        model = load(job.weights, job.on_disk)
    except UnusableWeights as why:
        return report(str(why))
    with np.load(job.picture, allow_pickle=False) as picture:
        mask = outline(model, picture["rgb"], picture["built"])
    with job.out.open("wb") as file:
        np.savez(file, mask=mask)


if __name__ == "__main__":
    main()
