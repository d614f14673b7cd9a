"""Chosen frames as JPEG files: with the time that the film tells, and the place that its subtitles do."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from datetime import datetime, timedelta
from pathlib import Path

import av
from PIL import ExifTags, Image

from aug3d_core.export.target_folder import check_empty
from aug3d_core.run.atomic_file import replacing
from aug3d_core.run.errors import UsageError
from aug3d_core.run.place_in_exif import set_place
from aug3d_core.video.choice import Frame, kept_frames, seconds_of
from aug3d_core.video.subtitles import NOWHERE, Track, beside, read_track

_QUALITY = 95


@dataclass(frozen=True)
class Taken:
    """What came of a film. overlaps: of each kept frame with the one before. placed: with a place."""

    film: Path
    seconds: float
    kept: int
    placed: int
    overlaps: tuple[float, ...]


def take_frames(
    films: Sequence[Path], folder: Path, overlap: float, progress: Callable[[Path, float, float], None]
) -> list[Taken]:
    """Write the frames of films, all of whose subtitles are checked first; raises UsageError, InputError.

    progress: is told the film, the second and how many there are.
    """
    check_empty(folder)
    stems = [_safe(film.stem) for film in films]
    if len(set(stems)) < len(stems):
        raise UsageError("two films have the same name", "rename one: their frames would have the same names")
    lengths = [seconds_of(film) for film in films]
    srt = [beside(film) for film in films]
    tracks = [read_track(file, seconds) if file else NOWHERE for file, seconds in zip(srt, lengths, strict=True)]
    folder.mkdir(parents=True, exist_ok=True)
    told = []
    for film, stem, seconds, track in zip(films, stems, lengths, tracks, strict=True):
        start, kept, placed = _started(film), [], 0
        for second, frame in kept_frames(film, overlap):
            progress(film, second, seconds)
            if frame is not None:
                _write(folder / f"{stem}_{frame.number:06d}.jpg", frame, start, track)
                kept.append(frame.overlap)
                placed += len(track.seconds) > 0
        told.append(Taken(film, seconds, len(kept), placed, tuple(kept[1:])))
    return told


def _safe(stem: str) -> str:
    """Return a film's name as part of the names of its frames."""
    return re.sub(r"[^\w.-]+", "_", stem) or "film"


def _started(film: Path) -> datetime | None:
    """Return when a film says that it began."""
    with av.open(str(film)) as container:
        told = container.metadata.get("creation_time") or container.streams.video[0].metadata.get("creation_time", "")
    try:
        return datetime.fromisoformat(told.replace("Z", "+00:00")).replace(tzinfo=None)
    except ValueError:
        return None


def _write(path: Path, frame: Frame, start: datetime | None, track: Track) -> None:
    exif = Image.Exif()
    if start is not None:
        time = (start + timedelta(seconds=frame.second)).strftime("%Y:%m:%d %H:%M:%S")
        exif[ExifTags.Base.DateTime] = time
        exif.get_ifd(ExifTags.IFD.Exif)[ExifTags.Base.DateTimeOriginal] = time
    lat_deg, lon_deg, alt_m = track.at(frame.second)
    if math.isfinite(lat_deg + lon_deg):
        set_place(exif, float(lat_deg), float(lon_deg), float(alt_m))
    with replacing(path, path.with_suffix(".part")) as file:
        Image.fromarray(frame.rgb).save(file, format="JPEG", quality=_QUALITY, subsampling=0, exif=exif)
