"""Ground control points: places that were surveyed, and where photographs show them.

Read from `gcp_list.txt`, as OpenDroneMap has it: a line with the projection, then a line for each mark: x, y and height of the
point; x and y of its pixel, in the photograph as it is stored; the photograph's name; and, if wanted, the point's name.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path, PurePosixPath
from typing import NoReturn

import numpy as np
import pandas as pd
from jaxtyping import Float
from rasterio._err import CPLE_BaseError  # of GDAL's errors, which have no public name
from rasterio.crs import CRS
from rasterio.errors import CRSError
from rasterio.warp import transform

from aug3d_core.geometry.geodesy import enu_from_geodetic, middle_of
from aug3d_core.run.errors import InputError

_CHECK = re.compile(r"ch(ec)?k", re.IGNORECASE)  # begins the name of a point that only judges
_UTM = re.compile(r"WGS ?84\s+UTM\s+(0?[1-9]|[1-5]\d|60)\s*([NS])", re.IGNORECASE)
_FORM = "Each line is: x y height pixel_x pixel_y photograph [point], separated by spaces or tabs."
_FARTHEST_M = 20_000.0  # from the photographs' GPS, or the other points, without a mistake
_SAME_M = 0.001
_NAMED = 3  # photographs, where many have the same name
_WGS84 = CRS.from_epsg(4326)


@dataclass(frozen=True)
class Mark:
    """A line: where a photograph shows a point. xyz: in the file's projection; a height may be NaN."""

    line: int
    xyz: tuple[float, float, float]
    pixel: tuple[float, float]
    photo: str
    point: str


def read_control(file: Path, photos: pd.DataFrame) -> tuple[pd.DataFrame, tuple[str, ...]]:
    """Return a row for each mark in a photograph of the table, and notes on what is not used.

    Columns: `point`, `check` (it only judges), `lat_deg`, `lon_deg`, `alt_m`, `photo_id`, `x_px`, `y_px` (of the working copy)
    and `line`. Heights stay on the datum of the file, and become metres. Raises InputError, with file and line, for what
    cannot be read, cannot be right, or has no mark in any of the photographs, or none of them with a height.
    """
    crs, marks = _parsed(file)
    rows = _rows(file, marks, photos["name"].tolist())
    _check_names(file, marks, rows)
    used = [mark for mark in marks if mark.photo in rows and not math.isnan(mark.xyz[2])]
    if not any(mark.photo in rows for mark in marks):
        raise InputError(
            f"{file} names none of the photographs: line {marks[0].line} has {marks[0].photo!r}",
            f"Name them as they are, such as {photos['name'].iloc[0]}.",
        )
    if not used:
        raise InputError(f"{file}: no point that these photographs show has a height", "Write it in the third column.")
    at = photos.iloc[[rows[mark.photo] for mark in used]]
    stored = at[["original_width_px", "original_height_px"]].to_numpy(float)
    for mark, size in zip(used, stored, strict=True):
        if not (0 <= mark.pixel[0] <= size[0] and 0 <= mark.pixel[1] <= size[1]):
            _refuse(
                file,
                mark.line,
                f"pixel ({mark.pixel[0]:g}, {mark.pixel[1]:g}) is outside {mark.photo}, which has "
                f"{size[0]:.0f} x {size[1]:.0f} px",
            )
    geodetic = _geodetic(file, crs, used, photos)
    pixels = np.array([mark.pixel for mark in used]).reshape(-1, 2)
    pixels = pixels * at[["width_px", "height_px"]].to_numpy(float) / stored
    table = pd.DataFrame(
        {
            "point": [mark.point for mark in used],
            "check": [bool(_CHECK.match(mark.point)) for mark in used],
            **{name: geodetic[:, axis] for axis, name in enumerate(("lat_deg", "lon_deg", "alt_m"))},
            "photo_id": at["photo_id"].to_numpy(),
            "x_px": pixels[:, 0],
            "y_px": pixels[:, 1],
            "line": [mark.line for mark in used],
        }
    )
    return table, _notes(file, crs, marks, rows)


def _rows(file: Path, marks: Sequence[Mark], names: Sequence[str]) -> dict[str, int]:
    """Return the row of each photograph by its name, and by that without folders; refuse marks of which several have that."""
    rows = {name: row for row, name in enumerate(names)}
    without_folder: dict[str, list[str]] = {}
    for name in names:
        without_folder.setdefault(PurePosixPath(name).name, []).append(name)
    for mark in marks:
        several = without_folder.get(mark.photo, [])
        if len(several) > 1 and mark.photo not in rows:
            problem = f"{mark.photo} is the name of several photographs: {', '.join(several[:_NAMED])}"
            _refuse(file, mark.line, problem, f"Write its folder too, such as {several[0]}.")
    return {name: rows[several[0]] for name, several in without_folder.items()} | rows


def _parsed(file: Path) -> tuple[CRS, list[Mark]]:
    """Return the projection and the marks of a file; points without a name are called by their place."""
    try:
        lines = file.read_text("utf-8-sig").splitlines()
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(f"{file} cannot be read: {error}", "Save it as plain text (UTF-8).") from error
    told = [(number, text.strip()) for number, text in enumerate(lines, start=1)]
    told = [(number, text) for number, text in told if text and not text.startswith("#")]
    if not told:
        raise InputError(f"{file} is empty", f"Its first line names the projection. {_FORM}")
    marks = [_mark(file, number, text) for number, text in told[1:]]
    if not marks:
        raise InputError(f"{file} has no point", _FORM)
    return _projection(file, *told[0]), marks


def _projection(file: Path, line: int, text: str) -> CRS:
    utm = _UTM.fullmatch(text)
    try:
        if utm:
            return CRS.from_epsg((32600 if utm[2].upper() == "N" else 32700) + int(utm[1]))
        return CRS.from_user_input(text)
    except (CRSError, ValueError):
        raise InputError(
            f"{file}, line {line}: {text[:80]!r} is no projection",
            "Begin the file with one, such as EPSG:32634, WGS84 UTM 34N, or a PROJ string.",
        ) from None


def _mark(file: Path, line: int, text: str) -> Mark:
    fields = [field.strip() for field in (text.split("\t") if "\t" in text else text.split())]
    if len(fields) < 6:
        _refuse(file, line, f"{len(fields)} columns, where 6 or 7 are needed")
    numbers = []
    for column, field in enumerate(fields[:5], start=1):
        try:
            numbers.append(float(field))
        except ValueError:
            _refuse(file, line, f"column {column}, {field[:40]!r}, is no number")
        if not (math.isfinite(numbers[-1]) or (column == 3 and math.isnan(numbers[-1]))):
            _refuse(file, line, f"column {column}, {field[:40]!r}, is no number that can be used")
    x, y, height, *pixel = numbers
    point = fields[6] if len(fields) > 6 and fields[6] else f"{x:.10g} {y:.10g}"
    return Mark(line, (x, y, height), (pixel[0], pixel[1]), fields[5], point)


def _check_names(file: Path, marks: Sequence[Mark], rows: dict[str, int]) -> None:
    """Refuse a name that stands for two places, and two marks of one point in one photograph. rows: of photographs by name."""
    first: dict[str, Mark] = {}
    marked: dict[tuple[str, str | int], Mark] = {}
    for mark in marks:
        known = first.setdefault(mark.point, mark)
        if (np.abs(np.subtract(known.xyz, mark.xyz)) > _SAME_M).any():  # never true of NaN
            _refuse(file, mark.line, f"{mark.point!r} is not where line {known.line} has it")
        if math.isnan(known.xyz[2]):
            first[mark.point] = mark
        again = marked.setdefault((mark.point, rows.get(mark.photo, mark.photo)), mark)
        if again is not mark:
            _refuse(file, mark.line, f"{mark.point!r} is marked in {mark.photo} already, by line {again.line}")


def _geodetic(file: Path, crs: CRS, marks: Sequence[Mark], photos: pd.DataFrame) -> Float[np.ndarray, "m 3"]:
    """Return latitude, longitude and height [m] of marks; raises InputError where they cannot be right."""
    xyz = np.array([mark.xyz for mark in marks]).reshape(-1, 3)
    places = _on_earth(crs, xyz)
    gps = photos[["lat_deg", "lon_deg"]].dropna().to_numpy(float)
    known = gps if len(gps) else places[np.isfinite(places[:, :2]).all(axis=1), :2]
    among = middle_of(known) if len(known) else np.full(2, np.nan)
    off_m = _distances_m(places, among)
    for mark, metres in zip(marks, off_m, strict=True):
        if not metres <= _FARTHEST_M:
            far = f"{metres / 1000:,.0f} km from {'the GPS of the photographs' if len(gps) else 'the other points'}"
            _refuse(
                file,
                mark.line,
                f"the point lies {far if math.isfinite(metres) else 'outside of its projection'}",
                _instead(crs, np.array([mark.xyz]), among) if len(gps) else "",
            )
    places[:, 2] *= _height_unit(crs)[1]
    return places


def _height_unit(crs: CRS) -> tuple[str, float]:
    """Return the unit of heights, and how many metres it has: of the third axis, where there is none of the other two."""
    told = crs.to_dict(projjson=True)
    while "coordinate_system" not in told:
        told = told["source_crs"] if "source_crs" in told else told["components"][-1]
    unit = told["coordinate_system"]["axis"][-1]["unit"]
    if isinstance(unit, dict) and unit["type"] == "LinearUnit":
        return unit["name"], unit["conversion_factor"]
    return "metre", 1.0  # so are heights over degrees


def _instead(crs: CRS, xyz: Float[np.ndarray, "1 3"], middle: Float[np.ndarray, " 2"]) -> str:
    """Say what change would bring a point to the photographs; nothing, if none would."""
    tries: list[tuple[str, Callable[[], Float[np.ndarray, "1 3"]]]] = [
        ("x and y look exchanged: the other way round", lambda: _on_earth(crs, xyz[:, [1, 0, 2]]))
    ]
    north = middle[0] >= 0
    zone = int((middle[1] + 180) // 6) % 60 + 1
    here = CRS.from_epsg((32600 if north else 32700) + zone)
    named = f"in WGS84 UTM {zone}{'N' if north else 'S'}"
    zoned = f"the zone looks wrong: {named}"
    without_zone = xyz - np.array([zone * 1e6, 0, 0])
    tries += [
        (zoned, lambda: _on_earth(here, xyz)),
        (f"{zoned}, with x and y exchanged", lambda: _on_earth(here, xyz[:, [1, 0, 2]])),
        (f"x begins with the zone: as {without_zone[0, 0]:.10g} {named}", lambda: _on_earth(here, without_zone)),
    ]
    for words, places in tries:
        if _distances_m(places(), middle)[0] <= _FARTHEST_M:
            return f"{words} it lies among them."
    return ""


def _on_earth(crs: CRS, xyz: Float[np.ndarray, "m 3"]) -> Float[np.ndarray, "m 3"]:
    """Return latitude, longitude and the height as it stands; NaN for what the projection has no place for."""
    try:
        lon_lat_deg = transform(crs, _WGS84, xyz[:, 0], xyz[:, 1])[:2]
    except (CRSError, ValueError, CPLE_BaseError):
        if len(xyz) > 1:  # one place that the projection does not have spoils all
            return np.concatenate([_on_earth(crs, one) for one in xyz[:, None]])
        lon_lat_deg = [[np.nan], [np.nan]]
    places = np.column_stack([*lon_lat_deg[::-1], xyz[:, 2]]).astype(float)
    places[~(np.abs(places[:, 0]) <= 90)] = np.nan
    return places


def _distances_m(places: Float[np.ndarray, "m 3"], middle: Float[np.ndarray, " 2"]) -> Float[np.ndarray, " m"]:
    level = np.column_stack([places[:, :2], np.zeros(len(places))])
    return np.linalg.norm(enu_from_geodetic(level, np.append(middle, 0.0)), axis=1)


def _notes(file: Path, crs: CRS, marks: Sequence[Mark], rows: dict[str, int]) -> tuple[str, ...]:
    notes = []
    if elsewhere := sorted({mark.photo for mark in marks if mark.photo not in rows}):
        others = f" and {len(elsewhere) - 1} more" if len(elsewhere) > 1 else ""
        notes.append(f"{file.name} marks points in photographs that are not used: {elsewhere[0]}{others}")
    if without := len({mark.point for mark in marks if math.isnan(mark.xyz[2])}):
        notes.append(f"{without} points of {file.name} have no height and are not used")
    unit, metres = _height_unit(crs)
    if metres != 1:
        notes.append(
            f"heights of {file.name} are in {unit}, as its projection says, and become metres (x {metres:.7g})"
        )
    return tuple(notes)


def _refuse(file: Path, line: int, problem: str, remedy: str = "") -> NoReturn:
    raise InputError(f"{file}, line {line}: {problem}", remedy or _FORM)
