"""An archive that claims more than its file holds is refused before anything in it is read."""

from __future__ import annotations

import io
import struct
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

from aug3d_core.run.stored_archive import check_stored

MIB = 2**20
LARGE = 2**28  # bytes that a bomb claims: five times what a reader may take, and not yet seconds of packing


def bomb(file: Path, entry: str, size_bytes: int) -> None:
    """Let an entry of an archive claim so many bytes, all zero, and take next to none."""
    with zipfile.ZipFile(file) as archive:
        contents = {name: archive.read(name) for name in archive.namelist()}
    with zipfile.ZipFile(file, "w") as archive:
        for name, content in contents.items():
            if name.endswith(f"/{entry}"):
                told = zipfile.ZipInfo(name)
                told.compress_type = zipfile.ZIP_DEFLATED
                with archive.open(told, "w", force_zip64=True) as out:
                    out.write(content)
                    for _ in range(size_bytes // MIB):
                        out.write(bytes(MIB))
            else:
                archive.writestr(name, content)


def archive(*names: str, compressed: bool = False) -> bytes:
    file = io.BytesIO()
    with zipfile.ZipFile(file, "w", zipfile.ZIP_DEFLATED if compressed else zipfile.ZIP_STORED) as made:
        for name in names:
            made.writestr(name, bytes(1000))
    return file.getvalue()


@pytest.mark.parametrize("content", [archive("a", "b"), archive(), b"", b"PK", b"a pickle of old"])
def test_what_holds_what_it_says_passes_and_is_at_its_start(content: bytes) -> None:
    file = io.BytesIO(content)
    check_stored(file)
    assert file.read() == content


def shared() -> bytes:
    """Return an archive whose second entry is the first: the bytes of one are claimed twice."""
    content = bytearray(archive("a", "b"))
    second = content.rindex(b"PK\x01\x02")
    struct.pack_into("<I", content, second + 42, 0)  # where its bytes begin
    first_end = content.index(b"PK\x03\x04", 4)
    held = content[:first_end] + content[content.index(b"PK\x01\x02") :]
    struct.pack_into("<I", held, len(held) - 6, first_end)
    return bytes(held)


@pytest.mark.parametrize(
    ("content", "said"),
    [
        (archive("a", compressed=True), r"^a is compressed, to \d+ of 1000 bytes"),
        (shared(), "its entries claim 2000 bytes, and it has 1"),
        (archive("a")[:500], "it is no whole archive"),
    ],
)
def test_what_claims_more_is_refused(content: bytes, said: str) -> None:
    with pytest.raises(ValueError, match=said):
        check_stored(io.BytesIO(content))


_READ = """
import resource, sys
from pathlib import Path
import torch
torch.save({"conv1.weight": torch.zeros(3)}, sys.argv[1])
from tests.run.test_stored_archive import LARGE, bomb
bomb(Path(sys.argv[1]), sys.argv[2], LARGE)
from aug3d_core.heads.pixelnerf.encoder_weights import _read
from aug3d_core.poses.torch_files import read_pt
from aug3d_core.run.errors import InputError
before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
for read in (_read, read_pt):
    try:
        read(Path(sys.argv[1]))
    except InputError as error:
        print(error.problem)
print((resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before) // 1024)
"""


@pytest.mark.slow
@pytest.mark.parametrize("entry", ["data.pkl", "version", "data/0"])
def test_a_thousand_times_what_is_stored_takes_no_memory(tmp_path: Path, entry: str) -> None:
    file = tmp_path / "weights.pth"
    root = Path(__file__).parents[2]
    words = [sys.executable, "-c", _READ, str(file), entry]
    done = subprocess.run(words, capture_output=True, text=True, check=True, cwd=root)
    *told, grown_mib = done.stdout.splitlines()
    assert file.stat().st_size < MIB
    assert len(told) == 2 and all(entry in line and "is compressed" in line for line in told)
    assert int(grown_mib) < 50
