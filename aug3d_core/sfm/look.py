"""Look at photographs by their largest features, before any is matched."""

from __future__ import annotations

from functools import cached_property
from pathlib import Path

import pandas as pd
from jaxtyping import Int, UInt8
from numpy import ndarray

from aug3d_core.run.stage import Progress
from aug3d_core.sfm.coarse import comparer
from aug3d_core.sfm.features import read_largest
from aug3d_core.sfm.retrieval import candidates, vectors


class LargestFeatures:
    """The largest features in a database, read when they are first asked for. ranked: how many pairs were compared."""

    def __init__(self, photos: pd.DataFrame, database: Path, seed: int, progress: Progress) -> None:
        self.photos, self.database, self.seed, self.progress = photos, database, seed, progress
        self.ranked = 0

    @cached_property
    def _largest(self) -> list[UInt8[ndarray, "_ 128"]]:
        return read_largest(self.photos, self.database)

    def compare(self, pairs: Int[ndarray, "m 2"]) -> Int[ndarray, " m"]:
        """Return how many features of each pair match."""
        self.ranked += len(pairs)
        return comparer(self._largest, self.progress)(pairs)

    def shortlist(self, wanted: Int[ndarray, " w"], most: int) -> Int[ndarray, "k 2"]:
        """Return the pairs of each wanted photograph with the `most` others whose vectors are most like its own."""
        return candidates(vectors(self._largest, self.seed, self.progress), wanted, most)
