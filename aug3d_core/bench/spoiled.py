"""Photographs that are spoiled on purpose, and how many of them a first look names."""

from __future__ import annotations

import shutil
from collections.abc import Mapping, Sequence
from pathlib import Path

from PIL import ExifTags, Image, ImageFilter

from aug3d_core.look.findings import findings_of
from aug3d_core.look.survey import Survey

_BLUR_PX, _DARKER, _WILD_DEG = 3.0, 0.4, 0.02
SPOILED = {
    "less sharp": (5, 33),
    "brighter or darker": (21,),
    "cannot be right": (12, 48),
}  # words of a finding: photographs


def spoil(photos: Sequence[Path], folder: Path) -> None:
    """Copy photographs, of which some become blurred, dark, or come from elsewhere by their GPS."""
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    soft, dark, wild = SPOILED.values()
    for i, photo in enumerate(photos):
        with Image.open(photo) as image:
            exif, picture = image.getexif(), image.convert("RGB")
        if i in soft:
            picture = picture.filter(ImageFilter.GaussianBlur(_BLUR_PX))
        if i in dark:
            picture = picture.point(lambda value: value * _DARKER)
        if i in wild:
            position = exif.get_ifd(ExifTags.IFD.GPSInfo)
            degrees = position[ExifTags.GPS.GPSLatitude]
            position[ExifTags.GPS.GPSLatitude] = (degrees[0], degrees[1], float(degrees[2]) + 3600 * _WILD_DEG)
        if i in (*soft, *dark, *wild):
            picture.save(folder / photo.name, exif=exif, quality=95)
        else:
            shutil.copy(photo, folder)


def recalled(survey: Survey, names: Sequence[str]) -> tuple[int, int]:
    """Return how many spoiled photographs are named for what is wrong with them, and how many others are named."""
    named: Mapping[str, set[str]] = {words: set() for words in SPOILED}
    other = 0
    for one in findings_of(survey):
        for words in named:
            if words in one.what:
                named[words] |= {*one.names}
                break
        else:
            other += 1
    true = {words: {names[i] for i in which} for words, which in SPOILED.items()}
    return sum(len(named[words] & true[words]) for words in true), other + sum(
        len(named[words] - true[words]) for words in true
    )
