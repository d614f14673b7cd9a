"""Panels: what went in, what was there, what the model made of it, and what the cheap answers did."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
from jaxtyping import Bool, Float, Int, UInt8
from PIL import Image, ImageDraw, ImageFont

from aug3d_core.dataset.contact import fitting
from aug3d_core.dataset.scene import Scene
from aug3d_core.heads.head import View
from aug3d_core.judging.names import called

LABEL_PX, GAP_PX = 16, 4
FONT_PX = 12  # smaller ones lose the spaces between words
STRIPE_PX = 4  # of the hatching of what is masked
SMALL_PX = 160  # views that are narrower are shown twice as large
ERROR_FULL = 64  # mean absolute error over channels that is drawn at full strength, 8-bit steps

# Dark blue over teal to yellow: five stops of a map that grows evenly in lightness.
STOPS = np.array([[38, 22, 74], [52, 84, 140], [32, 144, 140], [94, 201, 98], [253, 231, 37]], float)


def panel(
    scene: Scene,
    target: int,
    inputs: Int[np.ndarray, " v"],
    view: View,
    answers: Mapping[str, np.ndarray],
    scores: dict[str, float],
) -> UInt8[np.ndarray, "H W 3"]:
    """Draw one test view: a row of inputs and truth, a row of what the model says, a row of cheap answers."""
    truth = scene.images[target]
    rows = [
        [
            *((f"input {i + 1}", photograph(scene, v)) for i, v in enumerate(inputs)),
            ("truth", photograph(scene, target)),
        ],
        [
            (f"prediction {scores['psnr']:.1f} dB", view.colour),
            *((f"{called(name)} {scores[f'{name}_psnr']:.1f} dB", picture) for name, picture in view.parts.items()),
            *_depth(view),
            ("error", hatched(error_colours(truth, view.colour), scene.used(target))),
        ],
        [(f"{called(name)} {scores[f'{name}_psnr']:.1f} dB", image) for name, image in answers.items()],
    ]
    return grid(rows)


def summary_panel(
    scene: Scene, shown: list[tuple[int, Int[np.ndarray, " v"], View, Mapping[str, np.ndarray], dict[str, float]]]
) -> UInt8[np.ndarray, "H W 3"]:
    """Draw a row for each test view: nearest input, truth, prediction, depth, error, homography, mesh render, guided blend."""
    rows = []
    for target, _, view, answers, scores in shown:
        truth = scene.images[target]
        rows.append(
            [
                (f"nearest input {scores['nearest_copy_psnr']:.1f}", answers["nearest_copy"]),
                (f"truth, photo {scene.photo_id[target]}", photograph(scene, target)),
                (f"prediction {scores['psnr']:.1f} dB", view.colour),
                *_depth(view),
                ("error", hatched(error_colours(truth, view.colour), scene.used(target))),
                (f"homography {scores['ground_homography_psnr']:.1f}", answers["ground_homography"]),
                (f"mesh {scores['mesh_render_psnr']:.1f}", answers["mesh_render"]),
                (f"guided blend {scores['guided_blend_psnr']:.1f}", answers["guided_blend"]),
            ]
        )
    return grid(rows)


def novel_panel(
    scene: Scene, inputs: Int[np.ndarray, " v"], view: View, truth: int | None
) -> UInt8[np.ndarray, "H W 3"]:
    """Draw a view that was asked for: a row of inputs, a row of what the model says, and the truth if a row of the scene is."""
    said = [("prediction", view.colour), *_depth(view)]
    if truth is not None:
        error = hatched(error_colours(scene.images[truth], view.colour), scene.used(truth))
        said += [("truth", photograph(scene, truth)), ("error", error)]
    return grid([[(f"input: photo {scene.photo_id[v]}", photograph(scene, v)) for v in inputs], said])


def photograph(scene: Scene, view: int) -> UInt8[np.ndarray, "h w 3"]:
    """Return a view as it is shown to people: hatched where it is masked."""
    return hatched(scene.images[view], scene.used(view))


def hatched(picture: UInt8[np.ndarray, "h w 3"], used: Bool[np.ndarray, "h w"] | None) -> UInt8[np.ndarray, "h w 3"]:
    """Return a picture with grey stripes over what is masked."""
    if used is None:
        return picture
    y, x = np.indices(used.shape)
    stripes = np.where((x + y) // STRIPE_PX % 2, np.uint8(150), np.uint8(90))
    return np.where(used[..., None], picture, stripes[..., None])


def _depth(view: View) -> list[tuple[str, UInt8[np.ndarray, "h w 3"]]]:
    return [] if view.depth is None else [("depth", depth_colours(view.depth))]


def save(image: UInt8[np.ndarray, "H W c"], path: Path) -> None:
    """Write a picture."""
    Image.fromarray(image).save(path)


def depth_colours(
    depth: Float[np.ndarray, "h w"], bounds: tuple[float, float] | None = None
) -> UInt8[np.ndarray, "h w 3"]:
    """Draw depth from near (bright) to far (dark), between bounds or over the middle 98 % of its values."""
    near, far = bounds or np.quantile(depth, [0.01, 0.99])
    return _colours((far - depth) / max(far - near, 1e-9))


def error_colours(truth: UInt8[np.ndarray, "h w 3"], answer: UInt8[np.ndarray, "h w 3"]) -> UInt8[np.ndarray, "h w 3"]:
    """Draw the mean absolute error over channels."""
    return _colours(np.abs(truth.astype(float) - answer).mean(axis=-1) / ERROR_FULL)


def _colours(values: Float[np.ndarray, "h w"]) -> UInt8[np.ndarray, "h w 3"]:
    place = np.clip(values, 0, 1) * (len(STOPS) - 1)
    low = np.minimum(place.astype(int), len(STOPS) - 2)
    part = (place - low)[..., None]
    return (STOPS[low] * (1 - part) + STOPS[low + 1] * part).astype(np.uint8)


def grid(rows: list[list[tuple[str, np.ndarray]]]) -> UInt8[np.ndarray, "H W 3"]:
    """Draw rows of pictures of one size under their labels; they are shrunk where the sheet would be too large to be read."""
    height, width = rows[0][0][1].shape[:2]
    if width < SMALL_PX:
        height, width = 2 * height, 2 * width
    columns, beside_px = max(map(len, rows)), (GAP_PX, LABEL_PX + GAP_PX)
    width, height = fitting((width, height), beside_px, columns * len(rows))
    step_x, step_y = width + beside_px[0], height + beside_px[1]
    sheet = Image.new("RGB", (columns * step_x, len(rows) * step_y), "white")
    draw, font = ImageDraw.Draw(sheet), ImageFont.load_default(FONT_PX)
    for r, row in enumerate(rows):
        for c, (label, image) in enumerate(row):
            draw.text((c * step_x + 2, r * step_y), label, fill="black", font=font)
            fitted = Image.fromarray(image).resize((width, height), Image.Resampling.BOX)
            sheet.paste(fitted, (c * step_x, r * step_y + LABEL_PX))
    return np.asarray(sheet)
