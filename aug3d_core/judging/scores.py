"""Scores of the model and of the cheap answers on held-out photographs, by the rules of `conventions.py`."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from typing import NamedTuple

import flip_evaluator
import numpy as np
import pandas as pd
from jaxtyping import Bool, Int, UInt8
from skimage.metrics import peak_signal_noise_ratio, structural_similarity

from aug3d_core.dataset.scene import Scene
from aug3d_core.geometry.masks import continued
from aug3d_core.heads.head import Head, View
from aug3d_core.judging.cheap_answers import cheap_answers
from aug3d_core.judging.config import EvaluationConfig
from aug3d_core.judging.conventions import BEST_DB, FLIP, PEAK, SSIM, targets_masked
from aug3d_core.judging.inputs import chosen_inputs
from aug3d_core.judging.summary import CHEAP
from aug3d_core.run.errors import InputError


class Judged(NamedTuple):
    """A predicted view. target, inputs: rows of the scene. seconds: for the prediction."""

    target: int
    inputs: Int[np.ndarray, " v"]
    view: View
    seconds: float


def evaluate(
    head: Head,
    scene: Scene,
    config: EvaluationConfig,
    seen: Callable[[int, Judged], None] = lambda group, judged: None,
) -> pd.DataFrame:
    """Predict the target of every test group; one row each with the scores of every answer.

    seen: called with each group and what was judged of it.
    """
    check_test_groups(scene)
    rows = []
    masked = targets_masked(scene)
    for group, members in enumerate(scene.groups["test"]):
        target = int(members[0])
        inputs = chosen_inputs(scene, target, members[1:], config.input_views)
        started = time.perf_counter()
        view = head.predict(scene, target, inputs)
        seconds = time.perf_counter() - started
        answers = cheap_answers(scene, target, inputs)
        told = {"group": group, "photo_id": int(scene.photo_id[target]), "inputs": _ids(scene, inputs)}
        used = scene.used(target)
        told |= {"masked_share": 0.0 if used is None else float(1 - used.mean())} if masked else {}
        rows.append(told | _scores(scene, target, view, answers))
        seen(group, Judged(target, inputs, view, seconds))
    return pd.DataFrame(rows)


def _ids(scene: Scene, views: Int[np.ndarray, " v"]) -> str:
    return " ".join(str(photo) for photo in scene.photo_id[views])


def check_test_groups(scene: Scene) -> None:
    """Raise InputError unless every test group has a target and enough views to predict it from."""
    test = scene.groups["test"]
    support = test.shape[1] - 1
    if not len(test):
        raise InputError(
            "the data set has no test group", "give the scene more photographs, so that some can be held out"
        )
    if support < 1:
        raise InputError(
            "a test group has one member, its target: there is nothing to predict it from",
            "raise grouping.k, or give the scene more photographs of the test block",
        )


def _scores(scene: Scene, target: int, view: View, answers: Mapping[str, np.ndarray]) -> dict[str, float]:
    truth = scene.images[target]
    used = scene.used(target)
    scores = {name: score(truth, view.colour, used) for name, score in SCORES.items()}
    for name, picture in {**view.parts, **{name: answers[name] for name in CHEAP}}.items():
        scores |= {f"{name}_{score_name}": score(truth, picture, used) for score_name, score in SCORES.items()}
    return scores


# `used`: the pixels that count, one at least; None for all. Of the others nothing counts, not even beside those that do.


def psnr(
    truth: UInt8[np.ndarray, "h w 3"], answer: UInt8[np.ndarray, "h w 3"], used: Bool[np.ndarray, "h w"] | None = None
) -> float:
    """Return the PSNR in dB, at most BEST_DB."""
    if used is not None:
        truth, answer = truth[used], answer[used]
    if np.array_equal(truth, answer):
        return BEST_DB
    return float(peak_signal_noise_ratio(truth, answer, data_range=PEAK))


def ssim(
    truth: UInt8[np.ndarray, "h w 3"], answer: UInt8[np.ndarray, "h w 3"], used: Bool[np.ndarray, "h w"] | None = None
) -> float:
    """Return the mean structural similarity over pixels and channels; of pixels that have a whole window, if any has."""
    if used is not None:
        truth, answer = continued(truth, used), continued(answer, used)  # black would be alike in both
        each = np.asarray(structural_similarity(truth, answer, channel_axis=-1, full=True, **SSIM)[1])
        rim = SSIM["win_size"] // 2
        whole = np.zeros_like(used)
        whole[rim:-rim, rim:-rim] = used[rim:-rim, rim:-rim]
        return float(each[whole if whole.any() else used].mean())
    return float(np.asarray(structural_similarity(truth, answer, channel_axis=-1, **SSIM)))


def flip(
    truth: UInt8[np.ndarray, "h w 3"], answer: UInt8[np.ndarray, "h w 3"], used: Bool[np.ndarray, "h w"] | None = None
) -> float:
    """Return the mean FLIP error, 0 (none) to 1: what people see when two pictures alternate (Andersson et al. 2020)."""
    if used is not None:
        truth, answer = continued(truth, used), continued(answer, used)  # black would be alike in both
    reference, test = ((picture / PEAK).astype(np.float32) for picture in (truth, answer))
    each, mean, _ = flip_evaluator.evaluate(reference, test, "LDR", applyMagma=False, parameters=dict(FLIP))
    return float(mean) if used is None else float(each[used].mean())


SCORES: Mapping[str, Callable[..., float]] = {"psnr": psnr, "ssim": ssim, "flip": flip}
