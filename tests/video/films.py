"""Films of a flight over a plane of noise, whose motion is known."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import cast

import av
import numpy as np
from av.video.stream import VideoStream
from PIL import Image, ImageFilter

SIZE_PX, PER_S = (320, 240), 10
_GROUND = Image.fromarray(np.random.default_rng(0).integers(0, 256, (130, 600), dtype=np.uint8)).resize(
    (2400, 520), Image.Resampling.BICUBIC
)


def picture(left_px: float, blur_px: float = 0.0) -> Image.Image:
    """Return what is seen when the left edge of the picture stands there."""
    left = round(left_px)
    seen = _GROUND.crop((left, 100, left + SIZE_PX[0], 100 + SIZE_PX[1])).convert("RGB")
    return seen.filter(ImageFilter.GaussianBlur(blur_px)) if blur_px else seen


def write_film(path: Path, pictures: Sequence[Image.Image], key_frames: bool = True, created: str = "") -> Path:
    """Write a film of PER_S pictures a second. key_frames: without, only what builds on them is kept."""
    with av.open(path, "w") as film:
        if created:
            film.metadata["creation_time"] = created
        stream = cast(
            VideoStream, film.add_stream("libx264", rate=PER_S, options={"crf": "18", "g": "1000", "bf": "0"})
        )
        stream.width, stream.height, stream.pix_fmt = *SIZE_PX, "yuv420p"
        packets = [packet for one in pictures for packet in stream.encode(av.VideoFrame.from_image(one))]
        for packet in [*packets, *stream.encode()]:
            if key_frames or not packet.is_keyframe:
                film.mux(packet)
    return path


def flight(seconds: float, px_per_s: float, blurred: Sequence[int] = ()) -> list[Image.Image]:
    return [picture(i / PER_S * px_per_s, 3.0 if i in blurred else 0.0) for i in range(round(seconds * PER_S))]


def write_srt(
    path: Path,
    seconds: float,
    line: str = "[latitude: {lat:.6f}] [longitude: {lon:.6f}] [rel_alt: 51.2 abs_alt: {alt:.1f}]",
) -> Path:
    """Write subtitles, one a second, of a drone that flies north."""
    parts = []
    for i in range(round(seconds)):
        told = line.format(lat=46.9 + i * 1e-5, lon=7.5, alt=590.0 + i)
        parts.append(f"{i + 1}\n00:00:{i:02d},000 --> 00:00:{i + 1:02d},000\n<font>F/2.8 {told}</font>\n")
    path.write_text("\n".join(parts))
    return path
