"""Archives that hold what they say: torch writes its files as zip archives, and reads an entry as large as it claims to be."""

from __future__ import annotations

import zipfile
from io import BufferedIOBase

_BEGINS = b"PK\x03\x04"


def check_stored(file: BufferedIOBase) -> None:
    """Raise ValueError for an archive whose entries claim more than its file holds; the file is then at its start again.

    torch never compresses an entry: one that is compressed, or that shares its bytes with another, is to fill the memory.
    What is no archive passes.
    """
    if file.read(len(_BEGINS)) == _BEGINS:
        try:
            with zipfile.ZipFile(file) as archive:
                entries = archive.infolist()
        except zipfile.BadZipFile as error:
            raise ValueError(f"it is no whole archive: {error}") from error
        size = file.seek(0, 2)
        for entry in entries:
            if entry.compress_type != zipfile.ZIP_STORED or entry.file_size != entry.compress_size:
                raise ValueError(f"{entry.filename} is compressed, to {entry.compress_size} of {entry.file_size} bytes")
        if (claimed := sum(entry.file_size for entry in entries)) > size:
            raise ValueError(f"its entries claim {claimed} bytes, and it has {size}")
    file.seek(0)
