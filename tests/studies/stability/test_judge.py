"""What is judged: a figure, or how far it is above another one of the same stage."""

from __future__ import annotations

import pytest

from aug3d_core.studies.stability.perturbation import Judge

OVER = Judge("psnr", "higher", 0.0, "no better than one colour", stage="evaluation", over="mean_colour")


def test_a_cheap_answer_is_taken_off() -> None:
    assert OVER.figure({"psnr": 18.0, "mean_colour": 16.5}) == pytest.approx(1.5)
    assert Judge("psnr", "higher", 0.0, "").figure({"psnr": 18.0, "mean_colour": 16.5}) == 18.0


@pytest.mark.parametrize("metrics", [{}, {"psnr": 18.0}, {"psnr": None, "mean_colour": 16.5}, {"psnr": "none"}])
def test_a_figure_that_is_not_there_is_none_and_broken(metrics: dict) -> None:
    assert OVER.figure(metrics) is None
    assert OVER.broken(OVER.figure(metrics))


def test_no_number_is_broken_whichever_way_is_better() -> None:
    assert OVER.broken(float("nan"))
    assert Judge("error", "lower", 1.0, "").broken(float("nan"))
