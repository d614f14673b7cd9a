"""Say which photographs have no place in the model, and the likely reason."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pandas as pd
from PIL import Image

from aug3d_core.photos.files import image_name

BLURRED, BARE = "too blurred", "no texture"
NO_OVERLAP, ISLAND = "too little overlap", "separate island"

_BARE_CONTRAST = 0.25  # of the placed photographs' contrast at large scale, which blur leaves and fog or water does not
_BLURRED_SHARPNESS = 0.25  # of the placed photographs' median
_FEW_FEATURES = 0.05  # of the placed photographs' median
_COMPARED = 20
_NAMED = 5


def unplaced_table(
    photos: pd.DataFrame, matching: pd.DataFrame, components: Sequence[Sequence[int]], images: Path
) -> pd.DataFrame:
    """Return a row for each photograph outside the first component: `photo_id`, `name`, `reason`, and what tells it.

    matching: the matching stage's table. components: photo ids, the used component first. `component` is the number of
    the photograph's own, -1 without one; `contrast` and `sharpness` are over the placed photographs' median.
    """
    placed = set(components[0])
    component_of = {photo_id: number for number, ids in enumerate(components) for photo_id in ids}
    counts = matching.set_index("photo_id")
    rows = photos.set_index("photo_id")
    some = sorted(placed)[:: max(1, len(placed) // _COMPARED)]
    contrast = np.median([_contrast(images, photo_id) for photo_id in some])
    sharpness = rows.loc[sorted(placed), "sharpness"].median()
    table = pd.DataFrame(
        [
            {
                "photo_id": int(photo_id),
                "name": rows.at[photo_id, "name"],
                "component": component_of.get(photo_id, -1),
                "features": int(counts.at[photo_id, "features"]),
                "matched_pairs": int(counts.at[photo_id, "matched_pairs"]),
                "contrast": _contrast(images, photo_id) / contrast,
                "sharpness": rows.at[photo_id, "sharpness"] / sharpness,
            }
            for photo_id in photos["photo_id"]
            if photo_id not in placed
        ],
        columns=["photo_id", "name", "component", "features", "matched_pairs", "contrast", "sharpness"],
    )
    few = _FEW_FEATURES * counts.loc[sorted(placed), "features"].median()
    reasons = np.select(
        [
            table["component"] > 0,
            table["contrast"] < _BARE_CONTRAST,
            table["sharpness"] < _BLURRED_SHARPNESS,
            table["features"] < few,
        ],
        [ISLAND, BARE, BLURRED, BARE],
        NO_OVERLAP,
    )
    table.insert(2, "reason", pd.Series(reasons, index=table.index, dtype="str"))
    return table


def unplaced_notes(table: pd.DataFrame, photos: int) -> tuple[str, ...]:
    """Say it in words: a sentence for each reason, and one for each further component."""
    notes = []
    names, component, reason = (table[column].to_numpy() for column in ("name", "component", "reason"))
    for each in (BLURRED, BARE, NO_OVERLAP):
        alike = names[reason == each]
        if len(alike):
            notes.append(f"{len(alike)} of {photos} photographs could not be placed ({each}): {listed(alike)}")
    islands = np.unique(component[component > 0])
    for number in islands:
        alike = names[component == number]
        notes.append(
            f"the photographs fall into {len(islands) + 1} parts that nothing connects, and only the largest is used; "
            f"part {number + 1} holds {len(alike)} of {photos}: {listed(alike)}"
        )
    return tuple(notes)


def listed(names: Sequence[str] | np.ndarray) -> str:
    """Return the first few names."""
    return ", ".join(names[:_NAMED]) + (", ..." if len(names) > _NAMED else "")


def _contrast(images: Path, photo_id: int) -> float:
    with Image.open(images / image_name(photo_id)) as image:
        grey = image.convert("L")
    return float(np.asarray(grey.resize((32, 24), Image.Resampling.BOX), float).std())
