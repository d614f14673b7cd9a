"""The factory as a list: every stage in order. Read it from top to bottom and you have read the method.

Each stage is declared beside its configuration, in the module `declared` of its package. Declarations are light to import;
the stage functions are imported only in the process that runs them.
"""

from __future__ import annotations

from aug3d_core.dataset.declared import DATASET
from aug3d_core.depth.declared import DEPTH
from aug3d_core.domes.declared import SAMPLING
from aug3d_core.groups.declared import GROUPING, SIMILARITY
from aug3d_core.judging.declared import EVALUATION
from aug3d_core.novel.declared import PREDICTION, PREVIEW
from aug3d_core.overlap.declared import OVERLAP
from aug3d_core.photos.declared import PHOTOS
from aug3d_core.poses.declared import POSES
from aug3d_core.rendering.declared import RENDERING
from aug3d_core.sfm.declared import MATCHING, SFM, SFM_OF_MODEL, SFM_OF_POSES
from aug3d_core.surface.declared import SURFACE
from aug3d_core.town.declared import MESH_TRUTH, OVERLAP_IN_TOWN, TOWN, TRUTH
from aug3d_core.training.declared import TRAINING

_GROUPED = (SIMILARITY, GROUPING)
_MESH = (DEPTH, SURFACE)
_LEARNED = (SAMPLING, RENDERING, DATASET, TRAINING, EVALUATION)
_AFTER_SFM = (*_GROUPED, *_MESH, OVERLAP, *_LEARNED)

TO_POSES = (PHOTOS, MATCHING, SFM)
FROM_PHOTOS = (PHOTOS, MATCHING, SFM, *_AFTER_SFM)
FROM_POSES = (PHOTOS, POSES, MATCHING, SFM_OF_POSES, *_AFTER_SFM)
FROM_MODEL = (PHOTOS, POSES, SFM_OF_MODEL, *_AFTER_SFM)
FROM_TOWN = (
    TOWN, PHOTOS, MATCHING, SFM, TRUTH, *_GROUPED, OVERLAP_IN_TOWN, *_MESH, MESH_TRUTH, *_LEARNED,
)  # fmt: skip
STAGES = {stage.name: stage for stage in (*FROM_TOWN, POSES, PREDICTION, PREVIEW)}
