"""The format of a pose file or folder, and its digest. Light: nothing is parsed here."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from pathlib import Path

from aug3d_core.run.digest import file_digest
from aug3d_core.run.errors import InputError
from aug3d_core.run.regular_file import opened

COLMAP, NERFSTUDIO, MEGA_NERF = "colmap", "nerfstudio", "mega-nerf"
DTU, MAP, GLB, CLOUD = "dtu", "map", "glb", "points"  # for export only
TRANSFORMS = "transforms.json"
COORDINATES, MAPPINGS, METADATA = "coordinates.pt", "mappings.txt", "metadata"
SPLITS = ("train", "val")
_MODEL_PLACES = (".", "sparse/0", "0", "sparse")
_MODEL_FILES = ("cameras", "images", "points3D")
_TRACK_LENGTH = slice(
    8 + 43, 8 + 43 + 8
)  # in points3D.bin, of the first point: after count, id, position, colour, error
_POINT_FIELDS = 8  # in points3D.txt, before the track
_RIG_FILES = ("rigs", "frames")  # additional files since COLMAP 3.12
_KINDS = (
    "a COLMAP model (cameras, images and points3D, .bin or .txt, also in sparse/0), a nerfstudio transforms.json, or a "
    "Mega-NeRF folder (coordinates.pt and train|val/metadata/*.pt)"
)


@dataclass(frozen=True)
class PoseFiles:
    """Recognised pose files. files: those that hold the poses, in a fixed order.

    has_points: whether the poses come with points and tracks.
    """

    kind: str
    folder: Path
    files: tuple[Path, ...]
    has_points: bool


def recognise(path: Path) -> PoseFiles:
    """Return the format of a path; raises InputError that lists the three formats if it is none of them."""
    if not path.exists():
        raise InputError(f"{path} does not exist", f"Name {_KINDS}.")
    if path.is_file():
        if path.suffix == ".json":
            return PoseFiles(NERFSTUDIO, path.parent, (path,), False)
        if path.stem in _MODEL_FILES and path.suffix in (".bin", ".txt"):
            return recognise(path.parent)
        raise InputError(f"{path} is not a pose file that aug3d reads", f"Name {_KINDS}.")
    found = _colmap(path) or _nerfstudio(path) or _mega_nerf(path)
    if found is None:
        raise InputError(f"{path} holds no camera poses that aug3d reads", f"Name {_KINDS}.")
    return found


def pose_digest(path: Path) -> str:
    """Return the SHA-256 over the kind, names and bytes of the pose files; photographs in the same folder do not count."""
    found = recognise(path)
    digest = hashlib.sha256(found.kind.encode())
    for file in found.files:
        name = file.relative_to(found.folder).as_posix()
        digest.update(f"{len(name.encode())}:{name}:{file_digest(file)}\n".encode())
    return digest.hexdigest()


def _colmap(path: Path) -> PoseFiles | None:
    for place in _MODEL_PLACES:
        folder = path / place
        for suffix in (".bin", ".txt"):
            files = [folder / f"{name}{suffix}" for name in _MODEL_FILES]
            missing = [file.name for file in files if not file.is_file()]
            if not missing:
                files += [file for name in _RIG_FILES if (file := folder / f"{name}{suffix}").is_file()]
                return PoseFiles(COLMAP, folder, tuple(files), _has_points(files[2]))
            if len(missing) < len(files):
                raise InputError(
                    f"{folder} is an incomplete COLMAP model: {', '.join(missing)} is missing",
                    "Copy all of cameras, images and points3D there, with one ending.",
                )
    return None


def _has_points(points: Path) -> bool:
    """Say whether there are points and it is known which images see them: look at the first."""
    if points.suffix == ".bin":
        with opened(points) as file:
            head = file.read(_TRACK_LENGTH.stop)
        return any(head[:8]) and any(head[_TRACK_LENGTH])
    with opened(points) as file:
        first = next((line for line in file if line.strip() and not line.startswith(b"#")), b"")
    return len(first.split()) > _POINT_FIELDS


def _nerfstudio(path: Path) -> PoseFiles | None:
    file = path / TRANSFORMS
    return PoseFiles(NERFSTUDIO, path, (file,), False) if file.is_file() else None


def _mega_nerf(path: Path) -> PoseFiles | None:
    metadata = [file for split in SPLITS for file in sorted((path / split / METADATA).glob("*.pt"))]
    if not metadata and not (path / COORDINATES).is_file():
        return None
    if not metadata:
        raise InputError(
            f"{path} holds {COORDINATES} but no train/metadata/*.pt", "Name the whole Mega-NeRF folder, unpacked."
        )
    beside = [file for name in (COORDINATES, MAPPINGS) if (file := path / name).is_file()]
    return PoseFiles(MEGA_NERF, path, (*beside, *metadata), False)
