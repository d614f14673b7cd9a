"""Photographs are found, and only photographs; the folder's digest depends on them alone."""

from __future__ import annotations

import errno
import hashlib
import os
import random
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from aug3d_core.photos.discover import find_photos, folder_digest, natural_key
from aug3d_core.run.errors import InputError


def touch(folder: Path, *names: str) -> None:
    for name in names:
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_bytes(name.encode())


def test_natural_order() -> None:
    names = ["img_10.jpg", "img_9.jpg", "IMG_11.jpg", "b/img_1.jpg", "a/img_2.jpg"]
    assert sorted(names, key=natural_key) == ["a/img_2.jpg", "b/img_1.jpg", "img_9.jpg", "img_10.jpg", "IMG_11.jpg"]


@given(st.lists(st.text(st.sampled_from("aB0129_.é²/"), min_size=1, max_size=8), unique=True), st.randoms())
def test_natural_order_is_total(names: list[str], shuffler: random.Random) -> None:
    shuffled = list(names)
    shuffler.shuffle(shuffled)
    assert sorted(shuffled, key=natural_key) == sorted(names, key=natural_key)


def test_subfolders_are_walked_and_other_files_counted(tmp_path: Path) -> None:
    touch(
        tmp_path,
        "b.JPG",
        "sub/deeper/a.tiff",
        "c.jpeg",
        "d.png",
        "notes.txt",
        "sub/flight.log",
        "._b.JPG",
        ".trash/x.jpg",
    )
    found = find_photos(tmp_path)
    assert found.names == ("b.JPG", "c.jpeg", "d.png", "sub/deeper/a.tiff")
    assert found.ignored == 3


def test_linked_folders_are_not_entered(tmp_path: Path) -> None:
    touch(tmp_path / "elsewhere", "secret.jpg")
    touch(tmp_path / "photos", "a.jpg")
    (tmp_path / "photos" / "link").symlink_to(tmp_path / "elsewhere")
    (tmp_path / "photos" / "loop").symlink_to(tmp_path / "photos")
    assert find_photos(tmp_path / "photos").names == ("a.jpg",)


def test_a_subfolder_that_cannot_be_read_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    touch(tmp_path, "a.jpg", "sub/shut/b.jpg")
    scandir = os.scandir

    def guarded(path: str) -> object:
        if Path(path).name == "shut":
            raise PermissionError(errno.EACCES, os.strerror(errno.EACCES), str(path))
        return scandir(path)

    monkeypatch.setattr(os, "scandir", guarded)
    for look in (find_photos, folder_digest):
        with pytest.raises(InputError, match=r"sub/shut cannot be read: Permission denied\n.*readable"):
            look(tmp_path)


def test_no_folder(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="nowhere does not exist"):
        find_photos(tmp_path / "nowhere")


def test_not_a_folder(tmp_path: Path) -> None:
    touch(tmp_path, "a.jpg")
    with pytest.raises(InputError, match=r"a\.jpg is a file, not a folder"):
        folder_digest(tmp_path / "a.jpg")


def test_the_digest_is_of_the_photographs_alone(tmp_path: Path) -> None:
    one, two = tmp_path / "one", tmp_path / "two"
    touch(one, "b.jpg", "sub/a.jpg")
    touch(two, "sub/a.jpg", "b.jpg", "notes.txt")
    assert folder_digest(one) == folder_digest(two)


@pytest.mark.parametrize("change", ["content", "name", "more", "fewer"])
def test_the_digest_sees_every_change(tmp_path: Path, change: str) -> None:
    touch(tmp_path, "a.jpg", "b.jpg")
    before = folder_digest(tmp_path)
    if change == "content":
        (tmp_path / "a.jpg").write_bytes(b"other")
    elif change == "name":
        (tmp_path / "a.jpg").rename(tmp_path / "c.jpg")
    elif change == "more":
        touch(tmp_path, "c.jpg")
    else:
        (tmp_path / "a.jpg").unlink()
    assert folder_digest(tmp_path) != before


def test_the_digest_of_a_broken_link_is_not_an_error(tmp_path: Path) -> None:
    touch(tmp_path, "a.jpg")
    (tmp_path / "b.jpg").symlink_to(tmp_path / "gone.jpg")
    assert len(folder_digest(tmp_path)) == 64


def test_the_digest_is_over_names_as_they_are_on_the_disk(tmp_path: Path) -> None:
    """So a name that is not UTF-8 has one, and that of others is what it is for their UTF-8 bytes."""
    lines = []
    for name in (b"m\xe9vres.jpg", "müggelsee.jpg".encode()):
        Path(os.fsdecode(bytes(tmp_path) + b"/" + name)).write_bytes(name)
        lines.append(b"%d:%b:%b\n" % (len(name), name, hashlib.sha256(name).hexdigest().encode()))
    digest = folder_digest(tmp_path)
    assert digest in {hashlib.sha256(b"".join(order)).hexdigest() for order in (lines, lines[::-1])}


def test_masks_and_control_points_are_no_photographs_but_count(tmp_path: Path) -> None:
    touch(tmp_path, "a.jpg", "b.JPG", "sub/a.png", "sub/gcp_list.txt")
    alone = folder_digest(tmp_path)
    touch(tmp_path, "b_mask.png", "sub/a_MASK.PNG", "c_mask.png", "gcp_list.txt")
    found = find_photos(tmp_path)
    assert found.names == ("a.jpg", "b.JPG", "sub/a.png")
    assert found.masks == {"b.JPG": "b_mask.png", "sub/a.png": "sub/a_MASK.PNG"}
    assert found.control == "gcp_list.txt" and found.ignored == 2, (
        "a mask without a photograph, and a list in another folder"
    )
    digests = {alone, folder_digest(tmp_path)}
    for name in ("b_mask.png", "gcp_list.txt"):
        (tmp_path / name).write_bytes(b"another")
        digests.add(folder_digest(tmp_path))
    (tmp_path / "c_mask.png").write_bytes(b"another")
    assert len(digests) == 4 and folder_digest(tmp_path) in digests
