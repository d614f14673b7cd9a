"""Where a drone was while it filmed, as the subtitles beside its film tell (SRT files of DJI's drones).

Two forms are known: `[latitude: 46.9] [longitude: 7.5] [rel_alt: 51.2 abs_alt: 590.1]` (also `[longtitude`, as early firmware
spells it, and `[altitude: 590.1]`), and `GPS(7.5, 46.9, 590.1)`. Zeros are no fix.

Drones fill the second form in several ways: `GPS(131.1660,-25.2088,14)`, longitude first and then the number of satellites
(Mavic Pro, Phantom 4); `GPS(36.6146,-6.1120,0.0M)`, latitude first and no altitude (M300); `GPS(39.906217,116.391305,69.800)`,
latitude first (Avata 2). Where neither a unit nor a number beyond 90 tells, the longitude is taken as the first.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from jaxtyping import Float

from aug3d_core.run.errors import InputError
from aug3d_core.run.regular_file import MOST_TEXT_BYTES, content

_NUMBER = r"(-?\d+(?:\.\d+)?)"
_TIMES = re.compile(r"^(\d+):(\d\d):(\d\d)[,.](\d{1,3}) --> (\d+):(\d\d):(\d\d)[,.](\d{1,3})\s*$")
_LAT, _LON = re.compile(rf"\blatitude\s*:\s*{_NUMBER}"), re.compile(rf"\blongt?itude\s*:\s*{_NUMBER}")
_ALT = re.compile(rf"\b(?:abs_alt|altitude)\s*:\s*{_NUMBER}")
_GPS = re.compile(rf"\bGPS\s*\(\s*{_NUMBER}\s*,\s*{_NUMBER}\s*,\s*{_NUMBER}\s*(M?)[^)]*\)")
_OFF_S, _OFF_SHARE = 3.0, 0.02  # of a film's length, by which the end of its subtitles may differ


@dataclass(frozen=True)
class Track:
    """Places over time. seconds: of the film, rising. places: latitude, longitude [degrees], altitude [m] or NaN."""

    seconds: Float[np.ndarray, " n"]
    places: Float[np.ndarray, "n 3"]

    def at(self, second: float) -> Float[np.ndarray, " 3"]:
        """Return the place at a time, between two that are told, the short way round the earth; NaN where none is."""
        if not len(self.seconds):
            return np.full(3, np.nan)
        lat, lon, alt = self.places.T
        columns = lat, np.unwrap(lon, period=360), alt
        place = np.array([np.interp(second, self.seconds, column) for column in columns])
        place[1] -= 360 * np.round(place[1] / 360)
        return place


NOWHERE = Track(np.zeros(0), np.zeros((0, 3)))


def beside(film: Path) -> Path | None:
    """Return the subtitles with the name of a film, None if there are none."""
    found = [path for path in film.parent.glob("*") if path.stem == film.stem and path.suffix.lower() == ".srt"]
    return found[0] if found else None


def read_track(file: Path, film_seconds: float) -> Track:
    """Read where the drone was; raises InputError that names file and line.

    Subtitles without any place make a track without any. film_seconds: how long the film is: those of another are refused.
    """
    try:
        text = content(file, MOST_TEXT_BYTES).decode("utf-8-sig")
    except (OSError, UnicodeDecodeError) as error:
        to_do = "copy it again, or move it away: the film has no places then"
        raise InputError(f"{file} cannot be read ({error})", to_do) from error
    seconds, places, end, begun, line = [], [], 0.0, None, 0
    for line, written in enumerate(text.splitlines(), 1):
        if "-->" in written:
            times = _TIMES.match(written.strip())
            if times is None:
                raise _wrong(file, line, f"{written.strip()!r} are no times like 00:00:01,000 --> 00:00:02,000")
            begun, end = _second(*times.groups()[:4]), _second(*times.groups()[4:])
            if seconds and begun < seconds[-1]:
                raise _wrong(file, line, "its time lies before that of the place above")
        elif begun is not None and (place := _place(written)) is not None:
            if abs(place[0]) > 90 or abs(place[1]) > 180:
                raise _wrong(file, line, f"latitude {place[0]:g}, longitude {place[1]:g} is no place on earth")
            if place[0] or place[1]:
                seconds.append(begun)
                places.append(place)
            begun = None
    if line and not end:
        raise _wrong(file, 1, "there are no times in it")
    if abs(end - film_seconds) > max(_OFF_S, _OFF_SHARE * film_seconds):
        raise _wrong(
            file, line, f"its last time is {end:.1f} s, and the film has {film_seconds:.1f} s: it is of another film"
        )
    return Track(np.array(seconds), np.array(places).reshape(-1, 3))


def _place(written: str) -> tuple[float, float, float] | None:
    """Return latitude, longitude and altitude of a line, None if it tells none."""
    if gps := _GPS.search(written):
        return _of_gps(*gps.groups())
    lat, lon, alt = (one.search(written) for one in (_LAT, _LON, _ALT))
    return (float(lat[1]), float(lon[1]), float(alt[1]) if alt else float("nan")) if lat and lon else None


def _of_gps(first: str, second: str, third: str, unit: str) -> tuple[float, float, float]:
    """Return latitude, longitude and altitude of a `GPS(first, second, third unit)`: see above."""
    one, two = float(first), float(second)
    latitude_first = abs(one) <= 90 and (unit == "M" or abs(two) > 90)
    altitude = float(third) if "." in third and float(third) else float("nan")
    return (one, two, altitude) if latitude_first else (two, one, altitude)


def _second(hours: str, minutes: str, seconds: str, thousandths: str) -> float:
    return int(hours) * 3600 + int(minutes) * 60 + int(seconds) + int(thousandths.ljust(3, "0")) / 1000


def _wrong(file: Path, line: int, what: str) -> InputError:
    return InputError(
        f"{file}, line {line}: {what}", "put the subtitles of this film there, or move them away: it has no places then"
    )
