"""What a way of grouping may look at. Each way is a module with one function:

    group(scene, candidates, k, count, rng) -> members (C, K)

`candidates` are the views (indices) that may be used, `count` is the number of groups wanted, C <= count the number
made; row c holds the views of group c, its centre first.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from scipy import sparse

from aug3d_core.geometry.views import Views


@dataclass(frozen=True)
class GroupingScene:
    """Views, what they share, and where they look.

    shared: points that each pair of views shares (n x n). look_in_world: mean ground position of what a view sees.
    """

    views: Views
    shared: sparse.csr_array
    look_in_world: Float[np.ndarray, "n 2"]
