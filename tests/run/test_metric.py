"""What a figure means is declared by its name, or by a pattern of names."""

from __future__ import annotations

import pytest

from aug3d_core.run.metric import MetricSpec, declared, spec_of, unit_of


@pytest.mark.parametrize(
    ("name", "unit"),
    [
        ("reprojection_px", "px"), ("gps_residual_m_median", "m"), ("position_error_pct_max", "%"),
        ("test_psnr_ci_low", "dB"), ("over_best_cheap_db", "dB"), ("cheap_nearest_copy", "dB"),
        ("cheap_nearest_copy_ssim", ""), ("cheap_nearest_copy_flip", ""), ("over_nearest_copy_ci_low", "dB"),
        ("bad_members_share", ""), ("rays_per_second", "1/s"),
        ("texture_seconds", "s"), ("worker_growth_mib", "MiB"), ("photos", ""), ("mapper_reason", ""),
    ],
)  # fmt: skip
def test_the_unit_stands_in_the_name(name: str, unit: str) -> None:
    assert unit_of(name) == unit


def test_a_pattern_declares_names_that_come_from_data() -> None:
    metrics = declared(higher="kept_share heldout_*", lower="*_seconds", neither="heldout_px")
    assert spec_of("kept_share", metrics) == MetricSpec("", "higher")
    assert spec_of("match_seconds", metrics) == MetricSpec("s", "lower")
    assert spec_of("heldout_px", metrics) == MetricSpec("px", None), "a whole name goes before a pattern"
    assert spec_of("heldout_px_opencv", metrics) == MetricSpec("px", "higher")
    assert spec_of("kept", metrics) is None
