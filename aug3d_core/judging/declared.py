"""What the factory knows of the evaluation stage."""

from __future__ import annotations

from aug3d_core.judging.config import PRESETS, EvaluationConfig
from aug3d_core.run.metric import declared
from aug3d_core.run.stage import Stage

EVALUATION = Stage(
    name="evaluation",
    description="PSNR on held-out photographs.",
    config=EvaluationConfig,
    presets=PRESETS,
    inputs=("dataset", "training"),
    entry="aug3d_core.judging.stage:run",
    engines=("av", "flip-evaluator", "pillow", "scikit-image", "scipy", "torch"),
    runs=("training",),
    accuracy="test_psnr_mean",
    metrics=declared(
        higher=(
            "test_psnr_mean test_psnr_ci_low test_psnr_ci_high test_psnr_median test_psnr_p5 test_psnr_best "
            "test_psnr_worst test_ssim_mean *_psnr_mean over_* group_*"
        ),
        lower="test_flip_mean seconds_per_view",
        neither="head started_from test_views conventions test_photos cheap_*_ssim cheap_*_flip cheap_*",
    ),
    decidable=("input_views",),
)
