"""Malformed inputs, made from a seed: each is refused in words, or right. No hang, no traceback, no silent result."""

from __future__ import annotations

import copy
import json
import os
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch
from PIL import ExifTags, Image
from PIL.TiffImagePlugin import IFDRational
from safetensors.torch import save_file
from torch import nn
from typer import BadParameter, Exit

from aug3d_core.factory.config import scene_config
from aug3d_core.geometry.ply import Mesh
from aug3d_core.heads.pixelnerf.encoder_weights import start_trunk
from aug3d_core.heads.pixelnerf.resnet import ResNet34
from aug3d_core.heads.saved import load
from aug3d_core.heads.sweep.start import load_first_weights
from aug3d_core.photos.config import PhotosConfig
from aug3d_core.photos.decode import decode
from aug3d_core.photos.discover import folder_digest
from aug3d_core.poses.mega_nerf import read_mega_nerf
from aug3d_core.poses.nerfstudio import read_transforms
from aug3d_core.poses.recognise import recognise
from aug3d_core.run.errors import InputError
from aug3d_core.run.memory import MemoryBudget
from aug3d_core.scene_files.check import checked_entry
from flows.predict import _place
from tests.attack.inputs import Attack, assert_withstood
from tests.photos.photo_files import write_photo

pytestmark = pytest.mark.attack
HUGE = 10**400
BAD_VALUES = (float("nan"), float("inf"), -1e400, HUGE, "x", "", None, [], {}, True, [[1, 2], [3]], "\ud800")


@pytest.fixture
def rng() -> np.random.Generator:
    return np.random.default_rng(22)


def test_photographs(tmp_path: Path, rng: np.random.Generator) -> None:
    assert_withstood(photographs(tmp_path, rng), 70)


def photographs(folder: Path, rng: np.random.Generator) -> Iterator[Attack]:
    budget = MemoryBudget(2**28)

    def attack(path: Path, right: bool = False) -> Attack:
        config = PhotosConfig(min_px=32)
        return Attack(
            path.name, lambda: decode(path, path.name, folder / "copy.png", config, budget), "", lambda _: right
        )

    for kind in ("jpg", "png", "tif"):
        whole = write_photo(folder / f"whole.{kind}", size=(97, 71)).read_bytes()
        for number, length in enumerate([0, 1, 4, *rng.integers(5, len(whole), 9).tolist()]):
            path = folder / f"cut-{number}.{kind}"
            path.write_bytes(whole[:length])
            yield attack(path, right=kind == "jpg" and length > len(whole) - 8)
        for number in range(8):  # a photograph with other pixels is a photograph
            content = bytearray(whole)
            content[rng.integers(0, len(whole))] ^= 1 << rng.integers(0, 8)
            path = folder / f"bit-{number}.{kind}"
            path.write_bytes(content)
            yield attack(path, right=True)
    odd: list[tuple[dict[int, Any], dict[int, Any]]] = [
        ({ExifTags.Base.DateTimeOriginal: "9999:12:31 23:59:59", ExifTags.Base.SubsecTimeOriginal: "9" * 400}, {}),
        ({ExifTags.Base.DateTimeOriginal: "0001:01:01 00:00:00"}, {}),
        ({ExifTags.Base.FocalLength: IFDRational(1, 0)}, {}),
        ({ExifTags.Base.FocalLengthIn35mmFilm: 0}, {}),
        ({}, {ExifTags.GPS.GPSLatitude: (IFDRational(1, 0),) * 3, ExifTags.GPS.GPSLongitude: (1.0, 2.0, 3.0)}),
        ({}, {ExifTags.GPS.GPSLatitude: (float("inf"),) * 3}),
    ]
    for number, (detail, gps) in enumerate(odd):
        yield attack(write_photo(folder / f"exif-{number}.jpg", size=(97, 71), detail=detail, gps=gps), right=True)
    bomb = folder / "bomb.png"
    Image.new("1", (9000, 9000)).save(bomb)
    yield attack(bomb)
    os.mkfifo(folder / "pipe.jpg")
    (folder / "device.jpg").symlink_to("/dev/zero")
    (folder / "loop.jpg").symlink_to(folder / "loop.jpg")
    (folder / "nothing.jpg").symlink_to(folder / "gone.jpg")
    (folder / "folder.jpg").mkdir()
    for name in ("pipe.jpg", "device.jpg", "loop.jpg", "nothing.jpg", "folder.jpg"):
        yield attack(folder / name)
    for name in ("a?b.jpg", "a#b.jpg", "a%20b.jpg", "[a].jpg", "a'\"b.jpg", "a\nb.jpg", " .jpg"):
        yield attack(write_photo(folder / name, size=(97, 71)), right=True)
    yield Attack("the digest of all of them", lambda: folder_digest(folder), "", lambda told: len(told) == 64)


def test_poses_of_nerfstudio(tmp_path: Path, rng: np.random.Generator) -> None:
    assert_withstood(transforms(tmp_path, rng), 100)


def transforms(folder: Path, rng: np.random.Generator) -> Iterator[Attack]:
    camera = {"w": 64, "h": 48, "fl_x": 50.0, "fl_y": 50.0, "cx": 32.0, "cy": 24.0, "k1": 0.0}
    whole = {**camera, "frames": [{"file_path": f"{n}.png", "transform_matrix": np.eye(4).tolist()} for n in range(3)]}

    def attack(name: str, content: Any) -> Attack:
        file = folder / f"{name}.json"
        text = content if isinstance(content, str) else json.dumps(content)
        file.write_bytes(text.encode(errors="surrogatepass"))
        return Attack(name, lambda: read_transforms(file), str(file), finite)

    def finite(entries: Any) -> bool:
        return all(
            np.isfinite(e.cam_from_world).all() and np.isfinite(e.names[0][1].params).all() and e.names[0][0]
            for e in entries
        )

    for number, value in enumerate(BAD_VALUES):
        for key in camera:
            yield attack(f"{key}-{number}", {**whole, key: value})
        for key in ("file_path", "transform_matrix"):
            other = copy.deepcopy(whole)
            other["frames"][1][key] = value
            yield attack(f"{key}-{number}", other)
        yield attack(f"frames-{number}", {**whole, "frames": value})
        turned = np.eye(4).tolist()
        turned[0][0] = value
        other = copy.deepcopy(whole)
        other["frames"][1]["transform_matrix"] = turned
        yield attack(f"element-{number}", other)
    text = json.dumps(whole)
    for number, length in enumerate(rng.integers(0, len(text), 8).tolist()):
        yield attack(f"cut-{number}", text[:length])
    yield attack("deep", '{"frames": ' + "[" * 100_000)
    yield attack("digits", text.replace("50.0", "5" * 5000))
    yield attack("zero", {**whole, "frames": [{"file_path": "a", "transform_matrix": np.zeros((4, 4)).tolist()}]})
    yield attack("twice", {**whole, "frames": whole["frames"] * 2})


def test_poses_of_mega_nerf(tmp_path: Path) -> None:
    assert_withstood(mega_nerf(tmp_path), 10)


def mega_nerf(folder: Path) -> Iterator[Attack]:
    whole = {"W": 64, "H": 48, "intrinsics": torch.tensor([50.0, 50.0, 32.0, 24.0]), "c2w": torch.eye(4)[:3]}
    claims = torch.zeros(1).expand(2**31)
    bad = {
        "expanded": {**whole, "c2w": claims}, "shape": {**whole, "c2w": torch.eye(7)}, "nan": {**whole, "W": float("nan")},
        "huge": {**whole, "W": HUGE}, "text": {**whole, "intrinsics": "x"}, "none": {}, "list": [1, 2],
        "sparse": {**whole, "c2w": torch.eye(4).to_sparse()}, "complex": {**whole, "c2w": torch.eye(4)[:3] * 1j},
        "half": {**whole, "c2w": torch.zeros(3, 4)},
    }  # fmt: skip
    for name, content in bad.items():
        own = folder / name
        (own / "train" / "metadata").mkdir(parents=True)
        torch.save({"pose_scale_factor": 1.0, "origin_drb": torch.zeros(3)}, own / "coordinates.pt")
        torch.save(content, own / "train" / "metadata" / "000000.pt")
        yield Attack(name, lambda own=own: read_mega_nerf(recognise(own)), str(own))


def test_files_of_scenes() -> None:
    assert_withstood(scene_files(), 25)


def scene_files() -> Iterator[Attack]:
    bomb = "a: &a [1,2]\n" + "".join(
        f"{new}: &{new} [{','.join(['*' + old] * 8)}]\n" for old, new in zip("abcdef", "bcdefg", strict=True)
    )
    values = (".nan", ".inf", "-1", "9" * 400, "9" * 5000, "x", "[]", "0x" + "f" * 5000, "1e400", "true")
    settings = [f"settings: {{training: {{steps: {value}}}}}" for value in values]
    texts = [
        "photos: !foo /a", "photos: !!python/object/apply:os.system ['x']", bomb, "settings: " + "[" * 3000,
        "settings: " + "{a: " * 3000, "settings: &a {x: *a}", "photos: a\0b", "photos: a\nphotos: b", "!foo\nphotos: a",
        "description: !!timestamp 'x'", "settings: !!set {a, b}", "? [a, b]\n: 1", "photos: *nothing", "- a\n- b", "",
        "photos: 7", "preset: nothing\nphotos: a", "poses: 9\nphotos: a", 'description: "\\ud800"', "schedule: {cron: x}",
    ]  # fmt: skip
    for number, text in enumerate([*texts, *settings]):
        file = Path(f"/home/ann/scenes/hill{number}.yaml")
        content = text.encode(errors="surrogatepass")
        yield Attack(text[:40], lambda file=file, content=content: checked_entry(file, content), str(file))


def test_settings_and_places() -> None:
    assert_withstood(settings(), 30)


def settings() -> Iterator[Attack]:
    for value in ("nan", "inf", "1e400", "9" * 400, "", "x", "[]", "-1", "\ud800", "0x10"):
        for field in ("training.steps", "dataset.width_px", "training.learning_rate"):
            yield Attack(f"{field}={value}", lambda text=f"{field}={value}": usage(scene_config, "tiny", [text]))
    for text in ("nan,0,0", "inf,1,2", "1e400,0,0", "1,2", "", "a,b,c", "9" * 400 + ",0,0"):
        yield Attack(f"--at {text}", lambda text=text: _place("--at", text), "--at")


def usage(call: Any, *given: Any) -> Any:
    """Give a word of the command line to its reader: what typer refuses is refused."""
    try:
        return call(*given)
    except (BadParameter, Exit) as error:
        raise InputError(str(error), "as typer says") from error


def test_weights_and_clouds(tmp_path: Path, rng: np.random.Generator) -> None:
    assert_withstood(weights(tmp_path, rng), 30)


def weights(folder: Path, rng: np.random.Generator) -> Iterator[Attack]:
    save_file({"weight": torch.zeros(2, 3), "bias": torch.zeros(2)}, folder / "whole.safetensors")
    whole = (folder / "whole.safetensors").read_bytes()
    os.mkfifo(folder / "pipe.safetensors")
    (folder / "device.safetensors").symlink_to("/dev/zero")
    files = [folder / "pipe.safetensors", folder / "device.safetensors", folder / "gone.safetensors", folder]
    contents = [
        b"",
        whole[:7],
        whole[:-1],
        b"\xff" * 8 + whole[8:],
        (2**40).to_bytes(8, "little") + whole[8:],
        b"x" * 99,
    ]
    contents += [whole[:length] for length in rng.integers(8, len(whole) - 1, 4).tolist()]
    contents.append(whole.replace(b"[2,3]", b"[9,9]"))
    for number, content in enumerate(contents):
        files.append(folder / f"{number}.safetensors")
        files[-1].write_bytes(content)
    for file in files:
        yield Attack(f"start {file.name}", lambda file=file: load_first_weights(nn.Linear(3, 2), str(file)), str(file))
    for file in files[:4]:
        yield Attack(f"encoder {file.name}", lambda file=file: start_trunk(ResNet34(), str(file)), str(file))
    for number, text in enumerate(("", "{}", "[]", '{"head": 7}', '{"head": {"name": "none"}}', "[" * 100_000)):
        own = folder / f"model-{number}"
        own.mkdir()
        (own / "model.json").write_text(text)
        yield Attack(f"model {number}", lambda own=own: load(own), "model")
    mesh = Mesh(np.zeros((3, 3)), np.zeros((3, 3), np.uint8), np.array([[0, 1, 2]]))
    mesh.save(folder / "whole.ply")
    cloud = (folder / "whole.ply").read_bytes()
    for number, content in enumerate(
        [
            b"",
            b"ply\n",
            cloud[:-1],
            cloud + b"x",
            cloud.replace(b"vertex 3", b"vertex 999999999"),
            cloud.replace(b"3", b"-3"),
        ]
    ):
        file = folder / f"{number}.ply"
        file.write_bytes(content)
        yield Attack(f"cloud {number}", lambda file=file: cloud_of(file), file.name)
    yield Attack("endless cloud", lambda: cloud_of(Path("/dev/zero")), "/dev/zero")


def cloud_of(file: Path) -> Mesh:
    """Read a cloud as the scene of other photographs does, which turns both kinds of errors into words."""
    try:
        return Mesh.load(file)
    except (OSError, ValueError) as error:
        raise InputError(str(error), "give points as aug3d writes them") from error
