"""The arms of a study: setting by setting, and a grid over the whole factory."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from itertools import product

from aug3d_core.factory.config import SceneConfig
from aug3d_core.studies.tradeoff.arm import FACTORY, TradeoffArm
from aug3d_core.studies.tradeoff.setting import (
    AS_THE_PAPER,
    QUICK,
    SETTINGS,
    STEPS,
    TEST_PSNR,
    Setting,
    has,
    papers_values,
    resolved,
    spelled,
    value_of,
)

# No pictures are drawn: nobody looks at the many models of a study.
NOT_DRAWN = ("evaluation.panels=0", "evaluation.flythrough_frames=0")
# A quick study tests one model for each configuration, however few photographs: folds would cost 3 to 4 times as much.
ONE_FOLD = ("grouping.folds=1",)
_SEEDED = ("training.seed",)
# The grid over the whole factory, of the settings that the scene's head has.
# Values are the same as setting by setting, so that work is shared.
_AXES: Mapping[str, tuple[str, ...]] = {
    "photos.max_px": ("x5/16", "x1"),
    "depth.max_px": ("x1/2", "x1"),
    "training.head.hidden": ("x1/2", "x1"),
    "training.head.coarse_samples": ("x1/2", "x1"),
    "training.head.planes": ("x1/2", "x1"),
    "training.head.features": ("x1/2", "x1"),
}
_QUICK_AXES = tuple(field for field in _AXES if field.startswith("training.head."))
_RUNGS, _QUICK_RUNGS = ("x1/9", "x1/3", "x1"), ("x1/3", "x1")
_TRAINED_SHARE = 1 / 4  # of the steps, setting by setting, as in the other studies
_QUICK_SHARE = 1 / 20


def quick_effort(config: SceneConfig) -> tuple[str, ...]:
    """Return settings that train a network for seconds."""
    return _shortened(config, _QUICK_SHARE)


def setting_arms(config: SceneConfig, town: bool, quick: bool) -> list[TradeoffArm]:
    """Return an arm for every value of every setting, for the scene's own values, and for each difference from the paper."""
    known = [setting for setting in SETTINGS if all(has(field, config) for field in setting.fields)]
    chosen = [setting for setting in known if not quick or setting.name in QUICK]
    arms = [arm for setting in chosen for arm in _of_setting(setting, config, town, quick)]
    return arms if quick else [*arms, *_as_the_paper(config)]


def axes(config: SceneConfig, quick: bool) -> dict[str, list[str]]:
    """Return the values of each setting of the grid, cheapest first."""
    chosen = [field for field in (_QUICK_AXES if quick else _AXES) if has(field, config)]
    return {field: list(dict.fromkeys(resolved(field, value, config) for value in _AXES[field])) for field in chosen}


def rungs(config: SceneConfig, quick: bool) -> list[int]:
    """Return the numbers of training steps to try, fewest first."""
    values = _QUICK_RUNGS if quick else _RUNGS
    return sorted({int(resolved(STEPS, value, config)) for value in values})


def grid_arms(config: SceneConfig, quick: bool) -> list[TradeoffArm]:
    """Return every configuration of the grid, including the scene's own."""
    fields = axes(config, quick)
    chosen = [[*map("=".join, zip(fields, values, strict=True))] for values in product(*fields.values())]
    return [factory_arm(config, settings, steps) for settings in chosen for steps in rungs(config, quick)]


def factory_arm(config: SceneConfig, settings: Iterable[str], steps: int) -> TradeoffArm:
    """Return a configuration of the whole factory, named by its differences from the scene's own."""
    chosen = (*settings, f"{STEPS}={steps}")
    named = [one for one in chosen if one.partition("=")[2] != spelled(value_of(one.partition("=")[0], config))]
    label = ", ".join(one.replace("=", " ") for one in named) or "as the scene has it"
    return TradeoffArm(FACTORY, label, chosen, TEST_PSNR, seeded=_SEEDED, mark="" if named else "preset")


def auto_arm() -> TradeoffArm:
    """Return the configuration that the rules of `auto` decide."""
    return TradeoffArm(FACTORY, "auto", (), TEST_PSNR, seeded=_SEEDED, mark="auto")


def _of_setting(setting: Setting, config: SceneConfig, town: bool, quick: bool) -> Iterable[TradeoffArm]:
    own = tuple(spelled(value_of(field, config)) for field in setting.fields)
    values = setting.values[:1] if quick else setting.values
    tried = [tuple(resolved(field, value, config) for field in setting.fields) for value in values]
    shorter = setting.trained and not quick and STEPS not in setting.fields
    for chosen in dict.fromkeys((*tried, own)):
        yield TradeoffArm(
            setting.name,
            chosen[0],
            (
                *(_shortened(config, _TRAINED_SHARE) if shorter else ()),
                *(f"{field}={value}" for field, value in zip(setting.fields, chosen, strict=True)),
            ),
            setting.truth if town else setting.stand_in,
            setting.stages,
            setting.seeded,
            "preset" if chosen == own else "",
        )


def _as_the_paper(config: SceneConfig) -> Iterable[TradeoffArm]:
    """Yield the scene's own network, then one arm for each field in which it differs from the paper's.

    Fields with a panel of their own (width, samples) are charted there: a network as wide as the paper's takes hours.
    """
    steps = _shortened(config, _TRAINED_SHARE)
    elsewhere = {field for setting in SETTINGS for field in setting.fields}
    back = {field: value for field, value in papers_values(config).items() if field not in elsewhere}
    for field, value in {"": "", **back}.items():
        yield TradeoffArm(
            AS_THE_PAPER.name,
            f"{field.removeprefix('training.')} {value}" if field else "as the scene has it",
            (*steps, *([f"{field}={value}"] if field else [])),
            AS_THE_PAPER.truth,
            AS_THE_PAPER.stages,
            AS_THE_PAPER.seeded,
            "" if field else "preset",
        )


def _shortened(config: SceneConfig, share: float) -> tuple[str, ...]:
    fields = (STEPS, "training.warmup_steps")
    return tuple(f"{field}={max(1, round(share * float(value_of(field, config))))}" for field in fields)
