"""The files `<home>/collections/<name>.yaml`."""

from __future__ import annotations

import math
from pathlib import Path

import yaml

from aug3d_core.collections.entry import CollectionEntry
from aug3d_core.scene_files.check import checked
from aug3d_core.scene_files.registry import Registry
from aug3d_core.store import layout

_COMMENTS = {
    "train": "Scenes of the registry (aug3d scenes list) that the model is trained on.",
    "hold_out": "Scenes that it never sees. It is judged on their test photographs.",
    "towns": "Made-up towns that it is trained on besides: the first so many of this seed.",
    "preset": "Size of the training: tiny, small or paper. Each scene has a preset of its own in its file.",
    "settings": "Settings of training and evaluation that differ from the preset's, for example training: {steps: 500}.",
    "schedule": "When to train it again: cron (in quotes) or every (30m, 6h, 1d), and timezone. null: no schedule.",
    "publish": "A new version replaces the published one unless a scene loses more PSNR than this [dB].",
}


def _checked(file: Path, content: bytes) -> CollectionEntry:
    return checked(CollectionEntry, file, content)[0]


def written(name: str, entry: CollectionEntry) -> str:
    """Return the file of an entry, with comments."""
    parts = [f"# Collection {name} of aug3d. Edit it by hand as you like; `aug3d collections show {name}` checks it.\n"]
    for field, value in entry.model_dump(mode="json").items():
        if field in _COMMENTS:
            parts.append(f"\n# {_COMMENTS[field]}\n")
        parts.append(yaml.safe_dump({field: value}, sort_keys=False, allow_unicode=True, width=math.inf))
    return "".join(parts)


COLLECTIONS = Registry(layout.COLLECTIONS, "collection", "aug3d collections", _checked, written)
