"""What the factory knows of the surface stage."""

from __future__ import annotations

from aug3d_core.run.metric import declared
from aug3d_core.run.stage import Stage
from aug3d_core.split.files import SPLIT_TABLE
from aug3d_core.surface.config import PRESETS, SurfaceConfig
from aug3d_core.surface.files import PIECES

SURFACE = Stage(
    name="surface",
    description="The mesh.",
    config=SurfaceConfig,
    presets=PRESETS,
    inputs=("sfm", "grouping", "depth"),
    entry="aug3d_core.surface.stage:run",
    engines=("open3d", "pillow", "scipy"),
    accuracy="render_psnr",
    metrics=declared(
        higher=(
            "render_psnr covered_share flat_psnr render_psnr_full covered_share_full flat_psnr_full "
            "target_render_psnr target_covered_share target_flat_psnr target_render_psnr_full "
            "target_covered_share_full target_flat_psnr_full"
        ),
        lower="decimation_error_gsd *_seconds",
        neither=(
            "points tiles point_spacing_gsd octree_depth vertices triangles triangles_full bridged_share "
            "colour_detail_gsd texels charts exposure_spread baseline_points baseline_tiles baseline_point_spacing_gsd "
            "baseline_octree_depth baseline_vertices baseline_triangles baseline_triangles_full "
            "baseline_decimation_error_gsd baseline_bridged_share baseline_colour_detail_gsd baseline_texels "
            "baseline_charts baseline_exposure_spread needs"
        ),
    ),
    decidable=("texel_gsd",),
    resumable=True,
    shards=(f"{PIECES}/*/[!.]*.npz",),
    reads={"grouping": (SPLIT_TABLE,)},  # other groups of the same split change nothing
)
