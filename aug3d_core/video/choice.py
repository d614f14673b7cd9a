"""Which frames of a film are kept: those that overlap with the one before as asked, and of neighbours the sharpest.

A drone that hovers gives one frame, however long it does. Where frames show nothing of the one before (a cut, a fast turn)
one of them is kept too, and the next ones are measured against it.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import av
import numpy as np
from av.error import FFmpegError
from av.video.frame import VideoFrame
from jaxtyping import UInt8

from aug3d_core.look.glance import LOOKED_AT_PX
from aug3d_core.look.neighbours import Sketch, sketch_of, step
from aug3d_core.photos.decode import measure_sharpness
from aug3d_core.run.errors import InputError

LOOKS_PER_S = 10.0
_SPARE = 0.5  # of the way to the overlap that is asked for: from there on, the sharpest frame is taken
_BLURRED = 3  # frames in a row that may be too blurred to be found; more of them are another place
_MOST_HELD = 12  # frames that wait for their neighbours: 25 MB each at 4K
_MOST_PX = 2**27
_TO_DO = "copy it again, or convert it: ffmpeg -i FILM -c:v libx264 new.mp4"


@dataclass(frozen=True)
class Frame:
    """number: in the film, from 0. second: since its beginning. overlap: with the frame kept before, 0 for the first."""

    number: int
    second: float
    rgb: UInt8[np.ndarray, "h w 3"]
    sharpness: float
    overlap: float


@dataclass(frozen=True)
class _Look:
    number: int
    second: float
    frame: VideoFrame
    sketch: Sketch
    sharpness: float
    overlap: float = 0.0


def seconds_of(film: Path) -> float:
    """Return how long a film is; raises InputError for a file that is none."""
    with _opened(film) as container:
        stream = container.streams.video[0]
        if stream.duration is not None and stream.time_base is not None:
            return float(stream.duration * stream.time_base)
        return float(container.duration or 0) / av.time_base


def kept_frames(film: Path, overlap: float) -> Iterator[tuple[float, Frame | None]]:
    """Yield, for each look at a film, the second and the frame that is kept with it, or None; raises InputError.

    overlap: share of a frame that the next one shows too. A damaged film gives what comes before the damage, then the error.
    """
    last: Sketch | None = None
    waiting: list[_Look] = []  # frames that overlap as asked
    lost: list[_Look] = []  # frames since then in which nothing of the last one is found
    second = 0.0
    for look in _looks(film):
        second = look.second
        if last is None:
            last = look.sketch
            yield second, _kept(look)
            continue
        look = _after(last, look)
        if look.overlap == 0 and len(lost) < _BLURRED:
            lost.append(look)
        elif look.overlap >= _enough(overlap):
            lost = []
        elif look.overlap >= overlap and len(waiting) < _MOST_HELD:
            waiting, lost = [*waiting, look], []
        else:
            best = max(waiting or [*lost, look], key=lambda one: one.sharpness)
            last, lost = best.sketch, []
            yield second, _kept(best)
            since = [_after(last, one) for one in [*waiting, look] if one.number > best.number]
            waiting = [one for one in since if overlap <= one.overlap < _enough(overlap)]
            continue
        yield second, None
    if waiting or lost:
        yield second, _kept(max(waiting or lost, key=lambda one: one.sharpness))


def _enough(overlap: float) -> float:
    """Return the overlap below which a frame may be kept."""
    return overlap + _SPARE * (1 - overlap)


def _after(last: Sketch, look: _Look) -> _Look:
    return replace(look, overlap=step(last, look.sketch).overlap)


def _looks(film: Path) -> Iterator[_Look]:
    """Yield frames, LOOKS_PER_S of each second, with what a small copy tells."""
    with _opened(film) as container:
        stream = container.streams.video[0]
        stream.thread_type = "AUTO"
        due, any_frame = 0.0, False
        try:
            for number, frame in enumerate(container.decode(stream)):
                any_frame = True
                second = number / float(stream.average_rate or 25) if frame.time is None else float(frame.time)
                if second + 1e-6 >= due:
                    due = max(due + 1 / LOOKS_PER_S, second)
                    yield _look(number, second, frame)
        except FFmpegError as error:
            raise InputError(f"{film} is damaged ({error})", _TO_DO) from error
    if not any_frame:
        raise InputError(f"{film} has no picture that can be decoded: it may have no key frame", _TO_DO)


def _look(number: int, second: float, frame: VideoFrame) -> _Look:
    scale = min(LOOKED_AT_PX / max(frame.width, frame.height), 1.0)
    small = frame.to_image(width=max(round(frame.width * scale), 1), height=max(round(frame.height * scale), 1))
    return _Look(number, second, frame, sketch_of(np.asarray(small.convert("L"))), measure_sharpness(np.asarray(small)))


def _kept(look: _Look) -> Frame:
    return Frame(look.number, look.second, look.frame.to_ndarray(format="rgb24"), look.sharpness, look.overlap)


def _opened(film: Path) -> Any:
    """Open a file with a picture; raises InputError."""
    try:
        container = av.open(str(film))
    except (OSError, FFmpegError) as error:
        raise InputError(f"{film} is no film that can be read ({error})", _TO_DO) from error
    if (
        not container.streams.video
        or not 0 < container.streams.video[0].width * container.streams.video[0].height < _MOST_PX
    ):
        container.close()
        raise InputError(f"{film} has no picture", "give films")
    return container
