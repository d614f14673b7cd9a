"""How a head is trained from other first weights."""

from __future__ import annotations

from aug3d_core.training.config import presets


def test_random_weights_are_trained_longer_and_faster_than_shipped_ones() -> None:
    usual = presets("sweep")["tiny"]
    random = usual.from_random()
    assert random.head.model_dump()["start"] == "random" and usual.head.model_dump()["start"] != "random"
    assert random.steps > usual.steps and random.learning_rate > usual.learning_rate
    assert random.warmup_steps / random.steps == usual.warmup_steps / usual.steps
    assert random.seed == usual.seed


def test_a_head_that_always_starts_at_random_is_trained_as_ever() -> None:
    usual = presets("pixelnerf")["tiny"]
    assert usual.from_random() == usual == usual.started("towns")
