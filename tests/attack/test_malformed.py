# ruff: noqa: E501  (tables of inputs)
"""Malformed inputs, made by code from a seed: each is refused by name, left out with a reason, or read rightly.

None hangs, none ends in a traceback, none is taken in silence.
"""

from __future__ import annotations

import json
import math
import os
import random
import socket
import struct
import zlib
from collections import Counter
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import ExifTags
from PIL.TiffImagePlugin import IFDRational

from aug3d_core.collections.files import COLLECTIONS
from aug3d_core.factory.config import scene_config
from aug3d_core.geometry.ply import Mesh
from aug3d_core.novel.outside import outside_scene, photo_names, photos_digest
from aug3d_core.photos.config import PhotosConfig
from aug3d_core.photos.decode import Decoded, decode, shown
from aug3d_core.photos.discover import find_photos, folder_digest
from aug3d_core.photos.table import photo_table
from aug3d_core.poses.entry import Entry
from aug3d_core.poses.nerfstudio import read_transforms
from aug3d_core.run.memory import MemoryBudget
from aug3d_core.run.nested import flat
from aug3d_core.scene_files.check import checked_entry
from aug3d_core.store.scene_name import check_scene_name
from flows.predict import _place
from tests.attack.inputs import RIGHT, SILENT, Attack, assert_withstood, in_own_process
from tests.photos.photo_files import degrees, write_photo
from tests.toy_scene import toy_scene

pytestmark = pytest.mark.attack
SEED = 22
_HUGE = "9" * 400
_tallies: dict[str, Counter[str]] = {}


@pytest.fixture(autouse=True, scope="module")
def told(request: pytest.FixtureRequest) -> Iterator[None]:
    """Print the counts at the end."""
    yield
    capture: Any = request.config.pluginmanager.getplugin("capturemanager")
    with capture.global_and_fixture_disabled():
        for name, counts in _tallies.items():
            print(f"\n{name}: {counts.total()} malformed inputs: {dict(counts)}", end="")
        print(f"\n{sum(counts.total() for counts in _tallies.values())} malformed inputs in all")


def irregular(folder: Path, suffix: str) -> dict[str, Path]:
    """Make what has a file's name and is none."""
    folder.mkdir(parents=True, exist_ok=True)
    made = {
        name: folder / f"{name}{suffix}" for name in ("pipe", "zero", "null", "loop", "dangling", "folder", "to_pipe")
    }
    os.mkfifo(made["pipe"])
    made["zero"].symlink_to("/dev/zero")
    made["null"].symlink_to("/dev/null")
    made["loop"].symlink_to(made["loop"])
    made["dangling"].symlink_to(folder / "nothing")
    made["folder"].mkdir()
    made["to_pipe"].symlink_to(made["pipe"])
    made["socket"] = folder / f"socket{suffix}"
    here = Path.cwd()
    os.chdir(folder)  # the name of a socket is short
    with socket.socket(socket.AF_UNIX) as held:
        held.bind(made["socket"].name)
    os.chdir(here)
    return made


# --- photographs ---


def png_of(width: int, height: int, bits: int = 16, kind: int = 0) -> bytes:
    """Return a PNG whose header promises more than the file has."""
    head = struct.pack(">IIBBBBB", width, height, bits, kind, 0, 0, 0)
    parts = [(b"IHDR", head), (b"IDAT", zlib.compress(bytes(1000))), (b"IEND", b"")]
    return b"\x89PNG\r\n\x1a\n" + b"".join(
        struct.pack(">I", len(data)) + name + data + struct.pack(">I", zlib.crc32(name + data)) for name, data in parts
    )


def test_photographs(tmp_path: Path) -> None:
    rng = random.Random(SEED)
    folder = tmp_path / "photos"
    whole = {suffix: write_photo(folder / f"whole{suffix}") for suffix in (".jpg", ".png", ".tif")}

    def read(path: Path) -> Decoded:
        copy = tmp_path / "copies" / f"{abs(hash(path))}.png"
        copy.parent.mkdir(exist_ok=True)
        return decode(path, path.relative_to(folder).as_posix(), copy, PhotosConfig(), MemoryBudget(2**30))

    pixels = {suffix: read(path).pixels_sha256 for suffix, path in whole.items()}
    attacks: list[Attack] = []

    def add(name: str, path: Path, right: Callable[[Any], bool] = lambda _: False) -> None:
        attacks.append(Attack(name, lambda: read(path), right=right))

    for suffix, path in whole.items():
        data = path.read_bytes()
        for cut in [0, 1, 8, *(rng.randrange(len(data)) for _ in range(9))]:
            part = folder / f"cut{cut}{suffix}"
            part.write_bytes(data[:cut])
            add(part.name, part, lambda told, same=pixels[suffix]: told.pixels_sha256 == same)
    for size in [
        (13300, 13300),
        (2**31 - 1, 2**31 - 1),
        (60_000, 60_000),
        (1, 2**31 - 1),
        (0, 0),
        (0, 500),
        (500, 500),
    ]:
        path = folder / f"bomb{size[0]}_{size[1]}.png"
        path.write_bytes(png_of(*size))
        add(path.name, path)
    for suffix in (".jpg", ".png", ".tif"):
        for name, path in irregular(folder / f"irregular{suffix[1:]}", suffix).items():
            add(f"{name}{suffix}", path)
    for content in (b"", b"text", b"\xff\xd8\xff", b"GIF89a", b"<svg/>", b"II*\0\xff\xff\xff\xff", bytes(5000)):
        path = folder / f"other{len(attacks)}.jpg"
        path.write_bytes(content)
        add(f"content {content[:9]!r}", path)
    names = [
        "a?b",
        "a#b",
        "50%20",
        "[a]",
        "'a' \"b\"",
        "a\nb",
        " a ",
        "żółw",
        "a" * 200,
        "-rf",
        "$(id)",
        "a\\b",
        "{0}",
        "\t",
    ]
    for name in names:
        path = write_photo(folder / f"{name}.png", seed=rng.randrange(99))
        add(repr(name), path, lambda told, name=path.name: told.name == name)
    odd = folder / os.fsdecode(b"\xff\xfe.png")
    odd.write_bytes(whole[".png"].read_bytes())
    add("not UTF-8", odd)
    listed = find_photos(folder)
    assert {shown(path.name) for path in folder.iterdir() if path.is_file()} <= set(map(shown, listed.names))
    attacks.append(Attack("the digest of all", lambda: folder_digest(folder), right=lambda told: len(told) == 64))
    _tallies["photographs"] = assert_withstood(attacks, 60)


def _exifs() -> Iterator[tuple[str, dict[str, Any]]]:
    base, tag, gps = ExifTags.Base, "detail", ExifTags.GPS
    for text in (
        "9999:12:31 23:59:59",
        "0001:01:01 00:00:00",
        "2024:13:01 00:00:00",
        "0000:00:00 00:00:00",
        _HUGE,
        "",
        "\0" * 20,
    ):
        for subsecond in ("9" * 400, "-1", "99"):
            yield (
                f"time {text[:20]!r}.{subsecond[:4]}",
                {tag: {base.DateTimeOriginal: text, base.SubsecTimeOriginal: subsecond}},
            )
    for part in ((1, 0), (0, 0), (2**31 - 1, 1), (1, 2**31 - 1)):
        place = (IFDRational(*part),) * 3
        yield (
            f"GPS of {part}",
            {"gps": {gps.GPSLatitude: place, gps.GPSLongitude: place, gps.GPSAltitude: IFDRational(*part)}},
        )
        yield (
            f"focal length of {part}",
            {tag: {base.FocalLength: IFDRational(*part), base.FocalPlaneXResolution: IFDRational(*part)}},
        )
    yield "latitude of 91", {"gps": {gps.GPSLatitude: degrees(91), gps.GPSLongitude: degrees(10)}}
    yield "latitude of two parts", {"gps": {gps.GPSLatitude: degrees(1)[:2], gps.GPSLongitude: degrees(10)}}
    yield "orientation of 99", {"main": {base.Orientation: 99}}
    yield "camera of 60,000 characters", {"main": {base.Make: "x" * 20_000, base.Model: "\n" * 20_000}}
    yield "width of zero", {tag: {base.ExifImageWidth: 0, base.ExifImageHeight: 0, base.FocalLengthIn35mmFilm: 0}}


def test_what_a_camera_wrote(tmp_path: Path) -> None:
    def read(number: int, tags: dict[str, Any]) -> Any:
        path = write_photo(tmp_path / f"{number}.jpg", **tags)
        photo = decode(path, path.name, tmp_path / f"{number}.png", PhotosConfig(), MemoryBudget(2**30))
        table = photo_table([photo])
        table.to_parquet(tmp_path / "table.parquet")
        return table.iloc[0]

    def is_right(row: Any) -> bool:
        place = [row.lat_deg, row.lon_deg]
        return (
            row.orientation in range(1, 9)
            and (all(map(math.isnan, place)) or abs(place[0]) <= 90)
            and not math.isinf(row.focal_px)
            and not math.isinf(row.alt_m)
            and (row.time is None or row.time != row.time or 1900 <= row.time.year <= 2200)
        )

    attacks = [
        Attack(name, lambda number=number, tags=tags: read(number, tags), right=is_right)
        for number, (name, tags) in enumerate(_exifs())
    ]
    _tallies["EXIF"] = assert_withstood(attacks, 30)


# --- poses ---

_VALUES = [None, "x", "", [], {}, math.nan, math.inf, -1, 0, 1e400, 10**400, True, [[1]], "\0", "/dev/zero"]
_FRAME = ("file_path", "transform_matrix")
_CAMERA = ("fl_x", "fl_y", "cx", "cy", "w", "h", "k1", "k3", "k4", "p1", "camera_model", "frames")


def transforms(**changes: Any) -> dict[str, Any]:
    """Return poses as nerfstudio writes them, with changes at the top or in the first frame."""
    poses = [np.eye(4).tolist() for _ in range(2)]
    frames = [{"file_path": f"{i}.png", "transform_matrix": pose} for i, pose in enumerate(poses)]
    frames[0] |= {name: value for name, value in changes.items() if name in _FRAME}
    whole = {"fl_x": 300.0, "fl_y": 300.0, "cx": 12.0, "cy": 8.0, "w": 320, "h": 240, "frames": frames}
    return whole | {name: value for name, value in changes.items() if name not in _FRAME}


def entries_are_right(entries: list[Entry]) -> bool:
    return bool(entries) and all(
        np.isfinite(entry.cam_from_world).all() and np.isfinite(entry.names[0][1].params).all() for entry in entries
    )


def test_nerfstudio(tmp_path: Path) -> None:
    file = tmp_path / "transforms.json"
    texts = {
        f"{field} = {value!r:.20}": json.dumps(transforms(**{field: value}))
        for field in (*_FRAME, *_CAMERA)
        for value in _VALUES
    }
    good = json.dumps(transforms())
    texts |= {
        "deep": "[" * 100_000, "deep frames": good[:-1] + ', "x": ' + "[" * 50_000 + "]" * 50_000 + "}",
        "5000 digits": good.replace("320", "9" * 5000), "400 digits": good.replace("320", _HUGE),
        "list": "[]", "text": '"x"', "number": "1", "empty": "", "zeros": "\0" * 100,
        "frames of numbers": json.dumps(transforms(frames=[1, 2])), "two of a name": good.replace("1.png", "0.png"),
        "zero rotation": good.replace("1.0", "0.0"), "mirrored": good.replace("[1.0", "[-1.0"), "scaled": good.replace("1.0", "7.0"),
        "digits in a pose": good.replace("[1.0", f"[{_HUGE}"), "ragged pose": good.replace("[1.0, 0.0", "[1.0"),
    }  # fmt: skip
    contents = {name: text.encode() for name, text in texts.items()}
    rng = random.Random(SEED)
    contents |= {f"cut {cut}": good.encode()[:cut] for cut in (rng.randrange(1, len(good) - 1) for _ in range(8))}
    contents |= {"UTF-16": good.encode("utf-16"), "no UTF-8": b'{"frames": "\xff\xfe"}'}

    def read(content: bytes) -> list[Entry]:
        file.write_bytes(content)
        return read_transforms(file)

    attacks = [
        Attack(name, lambda content=content: read(content), str(file), entries_are_right)
        for name, content in contents.items()
    ]
    for name, path in irregular(tmp_path / "irregular", ".json").items():
        attacks.append(Attack(name, lambda path=path: read_transforms(path), str(path)))
    _tallies["nerfstudio"] = assert_withstood(attacks, 200)


def test_photographs_and_clouds_for_predict(tmp_path: Path) -> None:
    scene, file = toy_scene(0, 24, 16), tmp_path / "transforms.json"
    good = [write_photo(tmp_path / f"{i}.png", seed=i) for i in range(2)]
    bombs = {"bomb": png_of(60_000, 60_000), "large": png_of(13_300, 13_300), "cut": good[0].read_bytes()[:500]}
    bombs |= {"nothing": b"", "text": b"text", "torn": png_of(320, 240)}
    for name, content in bombs.items():
        (tmp_path / f"{name}.png").write_bytes(content)
    named = [f"{name}.png" for name in bombs] + [
        "gone.png",
        "a\0b",
        "x" * 5000,
        "..",
        "/dev/zero",
        "/proc/self/mem",
        "\ud800",
    ]
    named += [str(path) for path in irregular(tmp_path / "irregular", ".png").values()]

    def read(**changes: Any) -> Any:
        file.write_text(json.dumps(transforms(**changes)))
        photo_names(file)
        photos_digest(file)
        return outside_scene(file, scene)

    attacks = [
        Attack(repr(name)[:40], lambda name=name: read(file_path=name), "frame 0") for name in named
    ]  # fmt: skip
    finite = np.random.default_rng(SEED).uniform(-9, 9, (50, 3))
    clouds = {
        "nan": np.where(np.arange(50)[:, None] == 3, np.nan, finite), "infinite": finite * np.inf, "none": finite[:0],
        "one": finite[:1], "a point": np.zeros((50, 3)), "a line": finite * [1, 0, 0], "far": finite * 1e30,
    }  # fmt: skip
    for name, points in clouds.items():
        Mesh(points, np.zeros((len(points), 3), np.uint8), np.zeros((0, 3), int)).save(tmp_path / f"{name}.ply")
    data = (tmp_path / "one.ply").read_bytes()
    torn = {"cut": data[:-3], "header": data[:30], "more": data.replace(b"vertex 1", b"vertex 999999999999")}
    torn |= {
        "negative": data.replace(b"vertex 1", b"vertex -1"),
        "digits": data.replace(b"vertex 1", b"vertex " + b"9" * 5000),
    }
    torn |= {"words": data.replace(b"vertex 1", b"vertex"), "empty": b"", "text": b"end_header\nelement vertex x"}
    for name, content in torn.items():
        (tmp_path / f"torn_{name}.ply").write_bytes(content)
    given: list[Any] = [path.name for path in tmp_path.glob("*.ply")] + [
        7,
        [],
        {},
        True,
        math.nan,
        "",
        "\0",
        "/dev/zero",
        "x" * 5000,
    ]
    given += [str(path) for path in irregular(tmp_path / "no_clouds", ".ply").values()]

    def is_right(outside: Any) -> bool:
        return bool(np.isfinite([*outside.slab.as_dict().values(), *outside.near_far.ravel()]).all())

    attacks += [
        Attack(f"cloud {repr(cloud)[:40]}", lambda cloud=cloud: read(ply_file_path=cloud), "point cloud", is_right)
        for cloud in given
    ]
    _tallies["predict"] = assert_withstood(attacks, 45)


def _colmap_models(folder: Path) -> Iterator[Path]:
    cameras, images = "1 PINHOLE 320 240 300 300 160 120\n", "1 1 0 0 0 0 0 0 1 a.png\n\n2 1 0 0 0 1 0 0 1 b.png\n\n"
    texts = {
        "zero_quaternion": (cameras, images.replace("1 1 0 0 0", "1 0 0 0 0")), "nan": (cameras, images.replace("1 0 0 1 b", "nan 0 0 1 b")),
        "infinite": (cameras, images.replace("1 0 0 1 b", "inf 0 0 1 b")), "nan_quaternion": (cameras, images.replace("1 1 0 0 0", "1 nan 0 0 0")),
        "two_names": (cameras, images.replace("b.png", "a.png")), "two_ids": (cameras, images.replace("2 1 0", "1 1 0")),
        "no_camera": ("", images), "other_camera": (cameras.replace("1 PIN", "7 PIN"), images), "model": (cameras.replace("PINHOLE", "MAGIC"), images),
        "few": ("1 PINHOLE 320 240 300\n", images), "focal_zero": (cameras.replace("300", "0"), images), "focal_nan": (cameras.replace("300", "nan"), images),
        "size_zero": (cameras.replace("320 240", "0 0"), images), "size_negative": (cameras.replace("320", "-320"), images),
        "digits": (cameras.replace("300", _HUGE), images), "words": (cameras, "one two three\n\n"), "short": (cameras, "1 1 0\n\n"),
        "empty": ("", ""), "no_images": (cameras, ""), "no_name": (cameras, images.replace(" a.png", "")), "id_large": (cameras, images.replace("2 1 0", f"{2**64} 1 0")),
    }  # fmt: skip
    for name, (camera_text, image_text) in texts.items():
        (folder / name).mkdir(parents=True)
        for file, text in (("cameras", camera_text), ("images", image_text), ("points3D", "")):
            (folder / name / f"{file}.txt").write_text(text)
        yield folder / name
    camera = struct.pack("<QIiQQ4d", 1, 1, 1, 320, 240, 300, 300, 160, 120)
    image = struct.pack("<QI7dI", 1, 1, 1, 0, 0, 0, 0, 0, 0, 1) + b"a.png\0" + struct.pack("<Q", 0)
    zero = struct.pack("<QI7dI", 1, 1, 0, 0, 0, 0, 0, 0, 0, 1) + b"a.png\0" + struct.pack("<Q", 0)
    many = struct.pack("<Q", 2**63)
    binaries = {
        "b_zero_quaternion": (camera, zero, bytes(8)), "b_cameras": (many + camera[8:], image, bytes(8)), "b_images": (camera, many + image[8:], bytes(8)),
        "b_points": (camera, image, many), "b_observations": (camera, image[:-8] + many, bytes(8)), "b_name": (camera, image[:-14] + b"aaaa", bytes(8)),
        "b_empty": (b"", b"", b""), "b_model": (camera.replace(struct.pack("<i", 1), struct.pack("<i", 99), 3), image, bytes(8)),
        "b_nan": (camera, image.replace(struct.pack("<d", 1), struct.pack("<d", math.nan)), bytes(8)), "b_noise": (bytes(range(256)), bytes(range(256)), bytes(range(256))),
    }  # fmt: skip
    rng = random.Random(SEED)
    binaries |= {f"b_cut{i}": (camera[: rng.randrange(50)], image[: rng.randrange(8, 90)], bytes(8)) for i in range(6)}
    for name, parts in binaries.items():
        (folder / name).mkdir(parents=True)
        for file, content in zip(("cameras", "images", "points3D"), parts, strict=True):
            (folder / name / f"{file}.bin").write_bytes(content)
        yield folder / name
    for file in ("cameras", "images", "points3D"):
        path = folder / f"pipe_{file}"
        path.mkdir()
        for other, content in zip(("cameras", "images", "points3D"), (camera, image, bytes(8)), strict=True):
            os.mkfifo(path / f"{other}.bin") if other == file else (path / f"{other}.bin").write_bytes(content)
        yield path


def _count(name: str, given: list[tuple[str, Path]], least: int) -> None:
    found = in_own_process(given)
    bad = [
        f"{what}: {path}: {said}"
        for (_, path), (what, said) in zip(given, found, strict=True)
        if what not in ("refused", RIGHT)
    ]
    unnamed = [
        f"{SILENT}: {path}: {said}"
        for (_, path), (what, said) in zip(given, found, strict=True)
        if what == "refused" and not said.strip()
    ]
    assert not bad + unnamed, "\n".join(bad + unnamed)
    assert len(found) >= least
    _tallies[name] = Counter(what for what, _ in found)


def test_colmap(tmp_path: Path) -> None:
    given = [("colmap", path) for path in _colmap_models(tmp_path / "models")]
    _count("COLMAP", given, 38)
    # A matrix can be made of a zero quaternion: that it is finite says nothing.
    wrong = [one for one in given if "zero_quaternion" in one[1].name]
    assert len(wrong) == 2 and all("quaternion is zero" in said for _, said in in_own_process(wrong))


def test_mega_nerf_and_weights(tmp_path: Path) -> None:
    made = tmp_path / "made"
    made.mkdir()
    _write_tensors(made)
    weights = sorted(made.glob("*.safetensors")) + list(irregular(tmp_path / "irregular", ".safetensors").values())
    given = [("mega_nerf", path) for path in sorted((made / "mega").iterdir())]
    given += [(reader, path) for reader in ("sweep_start", "encoder") for path in weights]
    given += [
        ("encoder", path) for path in [*sorted(made.glob("*.pth")), *irregular(tmp_path / "pth", ".pth").values()]
    ]
    given += [("trained_head", path) for path in sorted((made / "heads").iterdir())]
    _count("Mega-NeRF and weights", given, 60)


def _write_tensors(folder: Path) -> None:
    """Write the files with torch, in a process of its own."""
    import subprocess
    import sys

    done = subprocess.run(
        [sys.executable, "-c", "import sys; from tests.attack.tensors import write; write(sys.argv[1])", str(folder)],
        cwd=Path(__file__).parents[2], capture_output=True, text=True,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr


# --- settings and files of the registry ---


def test_settings() -> None:
    fields = flat(scene_config("tiny").model_dump())
    numbers = [name for name, value in fields.items() if isinstance(value, int | float) and not isinstance(value, bool)]
    values = ["nan", "inf", "-inf", "1e400", _HUGE, "9" * 5000, "", "-1e-400x", "\0", "1_", "[1]", "0x1g"]
    attacks = [
        Attack(f"{name}={value[:12]!r}", lambda name=name, value=value: scene_config("tiny", [f"{name}={value}"]), name)
        for name in numbers
        for value in values
    ]
    for override in ("", "=", "x", "x=1", "training", "training.=1", ".steps=1", "training.steps", "a.b.c=1", "training.head=", "auto.x=1",
                     "training.steps.x=1", "training.head.x=1", "photos.__class__=1", "\ud800.x=1", "training.head.name=x"):  # fmt: skip
        attacks.append(Attack(repr(override), lambda override=override: scene_config("tiny", [override])))
    _tallies["--set"] = assert_withstood(attacks, 500)


def test_places() -> None:
    texts = ["nan,0,0", "0,inf,0", "0,0,-inf", "1e400,0,0", f"{_HUGE},0,0", f"{'9' * 5000},0,0", "", ",,", "1,2", "1,2,3,4", "a,b,c",
             "1;2;3", "1, 2", "\0,1,2", "٣,x,1", "1e308,1e308,1e308", "--1,2,3", "0x1,2,3", "1,2,", "\ud800,1,2"]  # fmt: skip
    attacks = [Attack(repr(text)[:30], lambda text=text: _place("--at", text), "--at") for text in texts]
    attacks.append(Attack("Arabic digits", lambda: _place("--at", "٣,1,2"), right=lambda told: told == (3, 1, 2)))
    _tallies["--at"] = assert_withstood(attacks, 20)


_YAML = {
    "tag": "photos: !!python/object/apply:os.system ['true']", "set": "photos: !!set {a}", "binary": "photos: !!binary aGk=", "own": "photos: !x y",
    "anchor": "photos: &a x\nposes: *a", "bomb": "a: &a [x,x]\nb: &b [*a,*a]\nc: [*b,*b]", "recursive": "a: &a [*a]", "deep": "photos: " + "[" * 20_000,
    "deep map": "photos: " + "{a: " * 5000, "merge": "<<: {photos: [x]}\npreset: tiny", "nan": "preset: .nan", "twice": "photos: x\nphotos: y", "tab": "photos:\n\tx",
    "empty": "", "text": "hello", "list": "- a", "number": "1", "null": "null", "digits": f"settings: {{training: {{steps: {_HUGE}}}}}",
    "5000 digits": f"settings: {{training: {{steps: {'9' * 5000}}}}}", "steps nan": "settings: {training: {steps: .nan}}", "loss nan": "publish: {most_psnr_drop_db: .nan}",
    "int keys": "1: 2", "complex key": "? [a, b]\n: c", "two documents": "photos: x\n---\nphotos: y", "directive": "%YAML 9.9\n---\nphotos: x", "colon": "photos: a: b",
    "quote": "photos: 'x", "zero": "photos: \0", "escape": 'photos: "\\0"', "surrogate": 'photos: "\\ud800"', "preset list": "photos: null\npreset: [tiny]",
    "settings text": "photos: null\nsettings: x", "settings list": "photos: null\nsettings: [x]", "stage text": "photos: null\nsettings: {training: x}",
    "head": "photos: null\nsettings: {training: {head: magic}}", "head list": "photos: null\nsettings: {training: {head: [1]}}", "auto": "photos: null\nsettings: {auto: x}",
    "schedule": "photos: null\nschedule: {cron: '99 99 * * *'}", "every": f"photos: null\nschedule: {{every: {_HUGE}d}}", "zone": "photos: null\nschedule: {every: 1d, timezone: ../../etc}",
    "sexagesimal": "photos: null\nschedule: {every: 1:30:00}", "octal": "photos: null\nsettings: {training: {steps: 0o17777777777777777777777}}",
    "hexadecimal": "photos: null\nsettings: {training: {steps: 0x" + "f" * 290 + "}}", "float": "photos: null\nsettings: {photos: {least_motion: 1e999}}", "tags": "photos: null\ntags: 5",
    "towns": f"towns: {_HUGE}", "towns nan": "towns: .nan", "train": "train: ../x", "train list": "train: [../x]", "train number": "train: [1]", "seed": "towns: 1\ntowns_seed: 1e400",
}  # fmt: skip


def test_files_of_the_registry(tmp_path: Path) -> None:
    attacks = []
    contents = {name: text.encode("utf-8", "surrogatepass") for name, text in _YAML.items()}
    contents |= {"no UTF-8": b"photos: \xff", "UTF-16": "photos: x".encode("utf-16"), "pairs": b"photos: x\n" * 3}
    for name, content in contents.items():
        file = tmp_path / "scene.yaml"
        for checked in (checked_entry, COLLECTIONS.checked):
            attacks.append(
                Attack(f"{name} ({checked.__module__})", lambda c=checked, f=file, b=content: c(f, b), str(file))
            )
    (tmp_path / "huge").mkdir()
    with (tmp_path / "huge" / "huge.yaml").open("wb") as file:
        file.truncate(2**40)
    for path in [tmp_path / "huge" / "huge.yaml", *irregular(tmp_path / "irregular", ".yaml").values()]:
        attacks.append(Attack(path.name, lambda path=path: COLLECTIONS.read_file(path), str(path)))
    _tallies["YAML"] = assert_withstood(attacks, 110)


def test_names() -> None:
    names = [
        "",
        ".",
        "..",
        "../x",
        "/etc",
        "a/b",
        "a\\b",
        "a b",
        "-x",
        "_x",
        "a\n",
        "a\0",
        "é",
        "٣",
        "a" * 65,
        "a?",
        "a#",
        "a%",
        "[a]",
        "\ud800",
        "a.yaml",
    ]
    attacks = [Attack(repr(name), lambda name=name: check_scene_name(name), repr(name)) for name in names]
    _tallies["names"] = assert_withstood(attacks, 20)
