"""Scenes that show the same ground: a model that is trained on one and judged on the other has seen the test.

By content: photographs that are in both, found by the digests of their files. By position: where the photographs of both
have GPS, those of the one that were taken within reach of the other's.
"""

from __future__ import annotations

from itertools import combinations

import numpy as np
import pandas as pd
from scipy.spatial import KDTree

from aug3d_core.collections.made import TOWN, TRAIN, Member
from aug3d_core.geometry.geodesy import enu_from_geodetic
from aug3d_core.photos.files import PHOTO_TABLE, read_photos
from aug3d_core.store.store import Store

NEAR_M = 100.0  # between photographs that may show the same ground: footprints of usual flights are as wide
TOLD_SHARE = 0.1  # of a scene's photographs near the other's


def overlapping(store: Store, members: dict[str, Member]) -> list[str]:
    """Return a sentence for each two scenes that show the same ground, one of which is trained on.

    Made-up towns all claim one position: they are compared by content alone.
    """
    tables = {
        name: read_photos(store.files_dir(member.photos, [PHOTO_TABLE]))
        for name, member in members.items()
        if member.role != TOWN and member.photos
    }
    found = []
    for one, other in combinations(sorted(tables), 2):
        if TRAIN not in (members[one].role, members[other].role):
            continue
        same = len(set(tables[one]["sha256"]) & set(tables[other]["sha256"]))
        if same:
            found.append(f"{same} photographs are in both {one} and {other}: a test of one was trained on in the other")
        elif not (members[one].made_up or members[other].made_up):
            share = near_share(tables[one], tables[other])
            if share >= TOLD_SHARE:
                found.append(
                    f"{one} and {other} were flown over the same ground: {share:.0%} of the photographs of one are within"
                    f" {NEAR_M:.0f} m of the other's, so a test of one may have been trained on in the other"
                )
    return found


def near_share(one: pd.DataFrame, other: pd.DataFrame) -> float:
    """Return the larger share of a scene's photographs that are near one of the other's; 0 where either has no GPS."""
    places = [table[["lat_deg", "lon_deg"]].dropna().to_numpy(float) for table in (one, other)]
    if not all(map(len, places)):
        return 0.0
    level = [np.column_stack([place, np.zeros(len(place))]) for place in places]
    a, b = (enu_from_geodetic(place, level[0][0])[:, :2] for place in level)
    shares = [float(np.mean(KDTree(there).query(here)[0] <= NEAR_M)) for here, there in ((a, b), (b, a))]
    return max(shares)
