"""Find the photographs in a folder. Light: the flow's own process imports this to name the folder's content."""

from __future__ import annotations

import hashlib
import os
import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path, PurePosixPath

from aug3d_core.run.digest import file_digest
from aug3d_core.run.errors import InputError

SUFFIXES = frozenset({".jpg", ".jpeg", ".png", ".tif", ".tiff"})
CONTROL_LIST = "gcp_list.txt"
_MASK = "_mask.png"  # ends a mask's name, after that of its photograph without suffix


@dataclass(frozen=True)
class Found:
    """What a folder holds; paths are relative to it.

    names: photographs, in natural order. ignored: how many other files. masks: photographs that have one, and its path.
    stray_masks: those beside which there is no photograph. control: the list of ground control points, "" for none.
    """

    names: tuple[str, ...]
    ignored: int
    masks: Mapping[str, str]
    stray_masks: tuple[str, ...]
    control: str


def natural_key(name: str) -> tuple[tuple[tuple[int, int, str], ...], str]:
    """Return the key that sorts `img_9` before `img_10`; names that differ only in case or zeros stay distinct."""
    parts = re.split(r"(\d+)", name.lower())
    return tuple((1, int(part), "") if i % 2 else (0, 0, part) for i, part in enumerate(parts)), name


def find_photos(folder: Path) -> Found:
    """List the photographs in a folder and below it, their masks, and the list of control points in the folder itself.

    Linked folders are not entered and hidden ones are skipped: neither loops, nor thumbnails, nor files from elsewhere
    come in by accident. Raises InputError if the folder, or one below it, is none or cannot be read.
    """
    if not folder.is_dir():
        what = "is a file, not a folder" if folder.exists() else "does not exist"
        raise InputError(f"{folder} {what}", "Name the folder that holds the photographs.")
    names: list[str] = []
    masks: dict[str, str] = {}
    others = 0
    for parent, folders, files in os.walk(folder, followlinks=False, onerror=_refuse):
        folders[:] = [name for name in folders if not name.startswith(".")]
        for file in files:
            name = (Path(parent) / file).relative_to(folder).as_posix()
            if file.startswith(".") or PurePosixPath(file).suffix.lower() not in SUFFIXES:
                others += 1
            elif file.lower().endswith(_MASK):
                masks[name[: -len(_MASK)]] = name
            else:
                names.append(name)
    masked = {name: masks[stem] for name in names if (stem := name[: -len(PurePosixPath(name).suffix)]) in masks}
    control = CONTROL_LIST if (folder / CONTROL_LIST).is_file() else ""
    stray = tuple(sorted(set(masks.values()) - set(masked.values()), key=natural_key))
    ignored = others + len(stray) - bool(control)
    return Found(tuple(sorted(names, key=natural_key)), ignored, masked, stray, control)


def trouble_with_photos(folder: Path) -> str | None:
    """Return why a folder has no photographs to give; None if it has."""
    trouble = trouble_with(folder)
    if trouble is None and not folder.is_dir():
        return "is a file, not a folder"
    if trouble is None and not find_photos(folder).names:
        return "holds no photographs"  # where a disk is not mounted, the folder is there, and empty
    return trouble


def trouble_with(path: Path) -> str | None:
    """Return why a file or folder cannot be looked at; None if it can."""
    try:
        path.stat()
    except FileNotFoundError:
        return "does not exist"
    except OSError as error:  # a network disk that went away, a folder that others may not enter
        return f"cannot be read: {error.strerror}"
    return None


def _refuse(error: OSError) -> None:
    # Without its photographs the scene would be another one, and nobody would know.
    raise InputError(
        f"{error.filename} cannot be read: {error.strerror}",
        "Make it readable for you, or move it out of the folder of photographs.",
    ) from error


def folder_digest(folder: Path) -> str:
    """Return the SHA-256 over the names and bytes of the photographs in a folder, of their masks, and of the control points.

    Other files do not count.
    """
    found = find_photos(folder)
    read = (*found.names, *found.masks.values(), *([found.control] if found.control else []))
    return digest_of({name: _content(folder / name) for name in read})


def digest_of(contents: Mapping[str, str]) -> str:
    """Return the digest of a folder whose photographs, by name, have these SHA-256."""
    digest = hashlib.sha256()
    for name in sorted(contents):
        on_disk = name.encode(errors="surrogateescape")  # need not be UTF-8
        digest.update(b"%d:%b:%b\n" % (len(on_disk), on_disk, contents[name].encode()))
    return digest.hexdigest()


def _content(path: Path) -> str:
    # An unreadable photograph must not stop the naming: the stage rejects it and says why.
    try:
        return file_digest(path)
    except OSError as error:
        return f"unreadable {error.errno}"
