"""Name what a folder of photographs holds from a process of its own: whoever orchestrates a run opens none of them."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

from aug3d_core.photos.discover import find_photos, folder_digest
from aug3d_core.run.errors import InputError
from aug3d_core.run.linux_process import SUPERVISED, die_with_parent


def digest_apart(folder: Path) -> str:
    """Return the `folder_digest` of a folder; raises InputError if it is none, or the process that reads it was killed."""
    find_photos(folder)  # what cannot be listed is told from here
    read = subprocess.run([sys.executable, "-m", __name__, str(folder)], capture_output=True, text=True)
    if read.returncode:
        said = read.stderr.strip().rpartition("\n")[2] or f"its reader ended with exit code {read.returncode}"
        raise InputError(f"the photographs in {folder} could not be read: {said}", "Run it again.")
    return read.stdout.strip()


if __name__ == "__main__":
    if SUPERVISED in os.environ:
        die_with_parent()
    print(folder_digest(Path(sys.argv[1])))
