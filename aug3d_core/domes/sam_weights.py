"""What of Segment Anything the settings name, and whether it is there. Looked at before a run: nothing heavy is imported."""

from __future__ import annotations

import re
from importlib.util import find_spec
from pathlib import Path

from aug3d_core.domes.config import SAM_FILES
from aug3d_core.run.errors import InputError

_ON_THE_HUB = re.compile(r"[\w.-]+/[\w.-]+")
WHERE = (
    "set sampling.sam_weights to a folder with config.json and model.safetensors of a Segment Anything model, or to one's "
    "name on the Hugging Face hub, such as facebook/sam-vit-base"
)


def find_weights(setting: str | None) -> tuple[str, bool]:
    """Return what the setting names, and whether it is a folder on disk. Raises InputError where it names nothing."""
    if find_spec("transformers") is None:
        raise InputError(
            "sampling.method sam needs the package transformers, which is not installed",
            "install it with: pip install 'aug3d[sam]', or choose sampling.method buildings",
        )
    if not setting:
        raise InputError("sampling.method sam needs weights, and sampling.sam_weights is empty", WHERE)
    folder = Path(setting).expanduser()
    folder = folder.parent if folder.is_file() else folder
    if folder.is_dir():
        for name in SAM_FILES:
            if not (folder / name).is_file():
                raise InputError(f"sampling.sam_weights {setting} has no {name}", WHERE)
        return str(folder.resolve()), True
    if not _ON_THE_HUB.fullmatch(setting):
        raise InputError(f"sampling.sam_weights {setting} is no folder and no name on the hub", WHERE)
    return setting, False
