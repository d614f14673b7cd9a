import math

import pytest

from aug3d_core.training.divergence import WINDOW, find_trouble, worse_than_one_colour

HEALTHY = dict(
    loss=0.02, error=0.009, gradient=0.1, light=0.9, front=0.01,
    spread=0.02, truth_spread=0.03, brightness=0.4, truth_brightness=0.45,
)  # fmt: skip
SYMPTOMS = {
    "no light is stopped on any ray": lambda step: step["light"] < 1e-4,
    "all light is stopped where rays begin": lambda step: step["front"] > 1 - 1e-4,
}
LOST = "pixels are worse than one colour, and were better"
DEAD = {
    "no light is stopped on any ray": HEALTHY | dict(light=0.0),
    "all light is stopped where rays begin": HEALTHY | dict(front=1.0),
    "every pixel is black": HEALTHY | dict(spread=0.0, brightness=0.0, error=0.23),
    "every pixel has the same colour": HEALTHY | dict(spread=1e-9, error=0.03),
    LOST: HEALTHY | dict(error=0.04),
}


def watched(steps):
    """Return the first trouble that is seen when steps are watched one by one."""
    return next((trouble for n in range(1, len(steps) + 1) if (trouble := find_trouble(steps[:n], SYMPTOMS))), None)


@pytest.mark.parametrize("what", DEAD)
@pytest.mark.parametrize("healthy", [200, 333, 1000])
def test_each_trouble_is_seen_within_500_steps_and_dated_to_when_all_was_well(what, healthy):
    trouble = watched([HEALTHY] * healthy + [DEAD[what]] * 500)
    assert trouble is not None
    assert trouble.what in (what, LOST)  # which is seen sooner where a block of steps happens to end
    assert healthy < trouble.seen_at <= healthy + 2 * WINDOW
    assert trouble.onset <= healthy


@pytest.mark.parametrize("name", ["loss", "gradient"])
@pytest.mark.parametrize("value", [math.nan, math.inf])
def test_what_is_not_finite_is_seen_at_once(name, value):
    assert watched([HEALTHY] * 7 + [HEALTHY | {name: value}]) == (7, 8, f"the {name} is {value}")


def test_a_network_that_was_ruined_before_it_learned_anything_is_seen():
    trouble = watched([HEALTHY | dict(error=0.02)] + [HEALTHY | dict(error=0.2)] * 400)
    assert trouble == (0, WINDOW, "pixels are twice as wrong as those of an untrained network")


def test_an_honest_start_is_left_alone():
    """The paper's network: far worse than one colour, then one grey with little spread, for hundreds of steps."""
    steps = [HEALTHY | dict(error=0.03 * (1 + 4 * math.exp(-n / 300)), spread=0.0005, light=0.05) for n in range(2000)]
    assert watched(steps) is None


def test_a_few_bad_steps_are_no_trouble():
    for what, step in DEAD.items():
        assert watched(([HEALTHY] * 150 + [step] * 40) * 5) is None, what


def test_a_scene_of_one_colour_may_be_shown_in_one_colour():
    assert watched([HEALTHY | dict(truth_spread=1e-6, spread=0.0, error=1e-7)] * 500) is None


def test_what_is_worse_than_one_colour_at_the_end_is_told():
    assert not worse_than_one_colour([HEALTHY] * 300)
    assert worse_than_one_colour([HEALTHY] * 300 + [HEALTHY | dict(error=0.04)] * WINDOW)
    assert worse_than_one_colour([HEALTHY | dict(error=0.04)] * 3)
