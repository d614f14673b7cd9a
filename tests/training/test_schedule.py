from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from aug3d_core.training.config import TrainingConfig
from aug3d_core.training.schedule import Probe, enough, last_step, probe_due, rate

CONFIG = TrainingConfig(steps=1200, warmup_steps=100)


def test_the_rate_warms_up_and_falls():
    rates = [rate(CONFIG, step) for step in range(1200)]
    assert rates[:100] == pytest.approx([3e-3 * (n + 1) / 100 for n in range(100)])
    assert all(a >= b for a, b in pairwise(rates[100:]))
    assert rate(CONFIG, 1200) == pytest.approx(3e-3 * CONFIG.final_rate_share)


@given(st.integers(200, 1199))
def test_the_tail_takes_what_is_left_of_the_cosine(tail_from):
    """It starts at the rate of the step before, falls, and ends at the same last rate, never later than planned."""
    end = last_step(CONFIG, tail_from)
    assert tail_from < end <= CONFIG.steps
    assert rate(CONFIG, tail_from, tail_from) == pytest.approx(rate(CONFIG, tail_from))
    tail = [rate(CONFIG, step, tail_from) for step in range(tail_from, end + 1)]
    assert all(a >= b for a, b in pairwise(tail))
    assert tail[-1] == pytest.approx(3e-3 * CONFIG.final_rate_share)
    assert all(rate(CONFIG, step, tail_from) <= rate(CONFIG, step) + 1e-12 for step in range(tail_from, end))


def test_each_restart_divides_the_rate_by_three():
    for step in (10, 500, 1100):
        assert rate(CONFIG, step, None, 2) == pytest.approx(rate(CONFIG, step) / 9)


def curve(gain_per_doubling, noise=0.0, steps=1200):
    """Return probes of a curve that gains so many dB each time the steps double."""
    jitter = np.random.default_rng(0).normal(0, max(noise, 1e-12), steps)
    return [Probe(n, gain_per_doubling * np.log2(n) + jitter[n - 1]) for n in range(20, steps + 1, 20)]


@pytest.mark.parametrize(("gain", "stops"), [(1.0, False), (0.3, False), (0.05, True), (0.0, True), (-0.5, True)])
def test_it_is_enough_when_half_as_many_steps_again_gain_too_little(gain, stops):
    assert enough(CONFIG, curve(gain)) is stops


def test_noise_puts_the_decision_off():
    assert enough(CONFIG, curve(0.05, noise=0.01))
    assert not enough(CONFIG, curve(0.05, noise=0.3))


def test_nothing_is_decided_from_a_few_probes_or_while_warming_up():
    assert not enough(CONFIG, curve(0.0)[:9])
    assert not enough(CONFIG.model_copy(update={"warmup_steps": 700}), curve(0.0))


def test_probes_are_as_many_as_planned_and_none_where_training_is_to_end_at_its_last_step():
    assert sum(probe_due(CONFIG, step) for step in range(1, 1201)) == 60
    fixed = CONFIG.model_copy(update={"least_gain_db": 0.0})
    assert not any(probe_due(fixed, step) for step in range(1, 1201))
