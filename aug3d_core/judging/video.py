"""A film as a file that browsers play: WebM with VP9, the same bytes from the same frames."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import cast

import av
import numpy as np
from av.video.stream import VideoStream
from jaxtyping import UInt8

_QUALITY = "24"  # the encoder's crf: 0 is without loss, 63 the worst


def save(frames: Sequence[UInt8[np.ndarray, "H W 3"]], path: Path, frames_per_second: int) -> None:
    """Write a film. A last odd row or column is left out: colours are kept for two by two pixels."""
    height, width = (side // 2 * 2 for side in frames[0].shape[:2])
    # bitexact: no random numbers in the file, and no date
    with av.open(path, "w", format="webm", options={"fflags": "+bitexact"}) as film:
        stream = cast(
            VideoStream, film.add_stream("libvpx-vp9", rate=frames_per_second, options={"crf": _QUALITY, "b": "0"})
        )
        stream.width, stream.height, stream.pix_fmt = width, height, "yuv420p"
        for frame in frames:
            picture = av.VideoFrame.from_ndarray(np.ascontiguousarray(frame[:height, :width]), format="rgb24")
            film.mux(stream.encode(picture))
        film.mux(stream.encode())
