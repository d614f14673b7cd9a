"""The settings that are tried: their values, the stages whose time they change, and the figure that judges them."""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction

from aug3d_core.factory.config import SceneConfig
from aug3d_core.run.nested import flat, value_at
from aug3d_core.training.config import presets

STEPS = "training.steps"
_PACKED, _OF_FOUR = ("dataset", "sampling"), 4  # px: sizes of packed views are multiples of it


@dataclass(frozen=True)
class Judge:
    """A figure of a stage, and its name on charts.

    per: another figure of the stage, by which it is divided. of_any_size: comparable between pictures of different sizes.
    """

    stage: str
    figure: str
    name: str
    lower_is_better: bool = False
    per: str = ""
    of_any_size: bool = False


@dataclass(frozen=True)
class Setting:
    """One setting and the values to try, all others as the scene has them.

    fields: `stage.field`; all get the same value. values: as written, or `x2/3`: times the scene's own value.
    stages: those whose time is charted. truth: the judge on the town. stand_in: the judge elsewhere.
    seeded: seeds that repeats count up; none where seeds have no effect, as with poses (1e-11 % of the extent).
    """

    name: str
    fields: tuple[str, ...]
    values: tuple[str, ...]
    stages: tuple[str, ...]
    truth: Judge
    stand_in: Judge
    seeded: tuple[str, ...]

    @property
    def trained(self) -> bool:
        """Whether a network must be trained to judge it."""
        return self.truth.stage == TEST_PSNR.stage


POSE_ERROR = Judge("truth", "position_error_pct", "position error (% of extent)", lower_is_better=True)
# Divided by the focal length: an angle can be compared between photographs of different sizes, pixels cannot.
REPROJECTION = Judge(
    "sfm", "reprojection_px", "reprojection error (focal lengths)", lower_is_better=True, per="focal_px"
)
FSCORE = Judge("mesh_truth", "fscore_half_pct", "F-score at 0.5 % of extent")
MESH_PSNR = Judge("mesh_truth", "mesh_render_psnr", "mesh against true views (dB)")
HELD_OUT_PSNR = Judge("surface", "target_render_psnr_full", "mesh against held-out photos (dB)")
TEST_PSNR = Judge("evaluation", "test_psnr_mean", "PSNR on held-out photos (dB)")
# PSNR cannot be compared between sizes. Its gain over the best cheap answer of the same size can.
OVER_CHEAP = Judge(
    "evaluation", "over_best_cheap_db", "PSNR over the best cheap answer of the same size (dB)", of_any_size=True
)


def _poses(name: str, field: str, values: tuple[str, ...], stages: tuple[str, ...] = ("matching", "sfm")) -> Setting:
    return Setting(name, (field,), values, stages, POSE_ERROR, REPROJECTION, ())


def _mesh(name: str, field: str, values: tuple[str, ...], stages: tuple[str, ...], truth: Judge) -> Setting:
    return Setting(name, (field,), values, stages, truth, HELD_OUT_PSNR, ())


def _views(
    name: str, fields: tuple[str, ...], values: tuple[str, ...], stages: tuple[str, ...], judge: Judge = TEST_PSNR
) -> Setting:
    return Setting(name, fields, values, stages, judge, judge, ("training.seed",))


_DENSE, _NETWORK = ("depth", "surface"), ("training", "evaluation")
_VIRTUAL = ("sampling", "rendering", "dataset")
_SIZE = ("sampling.width_px", "sampling.height_px")
SETTINGS = (
    _poses("features per photograph", "matching.max_features", ("x1/4", "x1/2", "x1", "x2")),
    _poses("first octave of SIFT", "matching.first_octave", ("1", "0", "-1")),
    _poses("size of the photographs (px)", "photos.max_px", ("x5/16", "x15/32", "x5/8"), ("photos", "matching", "sfm")),
    _poses("pair choice", "matching.pairs", ("exhaustive", "gps", "coarse")),
    _poses("mapper", "sfm.mapper", ("incremental", "global", "hierarchical"), ("sfm",)),
    _mesh("depth map width (px)", "depth.max_px", ("x1/2", "x3/4", "x1", "x5/4"), _DENSE, FSCORE),
    _mesh("depth planes: step (px)", "depth.plane_step_px", ("x1/2", "x1", "x2"), _DENSE, FSCORE),
    _mesh("depth: photographs compared", "depth.sources", ("x1/3", "x1/2", "x1", "x4/3"), _DENSE, FSCORE),
    _mesh("triangles: error bound (GSD)", "surface.max_error_gsd", ("x1/2", "x1", "x2", "x4"), ("surface",), MESH_PSNR),
    _mesh("texel (GSD)", "surface.texel_gsd", ("x2", "x1.4", "x1", "x0.7"), ("surface",), MESH_PSNR),
    _views("render samples", ("rendering.samples",), ("4", "16", "64"), ("rendering",)),
    _views("size of virtual views (px)", _SIZE, ("x2/3", "x1", "x4/3"), _VIRTUAL),
    _views("domes of virtual views", ("sampling.domes",), ("x1/4", "x1/2", "x1", "x2"), (*_VIRTUAL, *_NETWORK)),
    _views(
        "photographs enough of a place",
        ("grouping.enough",),
        ("3", "5", "8", "0"),
        (*_DENSE, *_VIRTUAL, *_NETWORK),
    ),
    _views("views in a group (K)", ("grouping.k",), ("4", "12", "auto"), ("grouping", *_VIRTUAL, *_NETWORK)),
    _views("width of the network", ("training.head.hidden",), ("x1/2", "x1", "x2"), _NETWORK),
    _views("samples on a ray", ("training.head.coarse_samples",), ("x1/2", "x1", "x2"), _NETWORK),
    _views("planes of the coarse volume", ("training.head.planes",), ("x1/2", "x1", "x2"), _NETWORK),
    _views("channels of the features", ("training.head.features",), ("x1/2", "x1", "x2"), _NETWORK),
    _views("width of a training crop (px)", ("training.head.crop_px",), ("x1/2", "x1", "x3/2"), _NETWORK),
    _views("input views", ("training.input_views", "evaluation.input_views"), ("1", "3", "6"), _NETWORK),
    _views("training steps", (STEPS,), ("x1/8", "x1/4", "x1/2", "x1"), _NETWORK),
    _views(
        "size of pictures (px)",
        ("dataset.width_px", "dataset.height_px", *_SIZE),
        ("x2/3", "x1", "x4/3"),
        (*_VIRTUAL, *_NETWORK),
        OVER_CHEAP,
    ),
)
# Each field without a panel of its own in which the scene's network differs from its head's preset `paper`, set to that
AS_THE_PAPER = _views("one thing as in the preset paper", (), (), _NETWORK)
# The duration of training and the file of initial weights are not part of the network
_NO_DIFFERENCE = {"steps", "least_gain_db", "checkpoint_every", "head.encoder_weights", "seed"}
# One setting of every kind, each with its first value: minutes
QUICK = (
    "features per photograph",
    "texel (GSD)",
    "render samples",
    "width of the network",
    "channels of the features",
)


def resolved(field: str, value: str, config: SceneConfig) -> str:
    """Return a value as `--set` takes it: `x2/3` is two thirds of the configuration's value, rounded if that is an integer."""
    if not value.startswith("x"):
        return value
    now = value_of(field, config)
    if value == "x1":
        return spelled(now)
    scaled = Fraction(value[1:]) * Fraction(now).limit_denominator(10**6)
    if isinstance(now, float):
        return f"{float(scaled):g}"
    unit = _OF_FOUR if field.partition(".")[0] in _PACKED and field.endswith("_px") else 1
    return str(max(unit, unit * round(scaled / unit)))


def papers_values(config: SceneConfig) -> dict[str, str]:
    """Return the value of each training field in which the scene's network differs from its head's preset `paper`."""
    own, paper = flat(config.training.model_dump()), flat(presets(config.training.head.name)["paper"].model_dump())
    return {
        f"training.{name}": spelled(theirs)
        for name, theirs in paper.items()
        if name not in _NO_DIFFERENCE and theirs != own[name]
    }


def has(field: str, config: SceneConfig) -> bool:
    """Say whether a configuration has `stage.field`: settings of a head are those of one model."""
    return field in flat(config.model_dump())


def value_of(field: str, config: SceneConfig) -> int | float | str:
    """Return the value of `stage.field` in a configuration."""
    stage, _, name = field.partition(".")
    return value_at(getattr(config, stage).model_dump(), name)


def spelled(value: float | str) -> str:
    """Return a value as `--set` takes it."""
    if isinstance(value, bool):
        return str(value).lower()
    return f"{value:g}" if isinstance(value, float) else str(value)
