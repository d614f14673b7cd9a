"""Settings of the plane sweep, and how it is trained in each preset."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any, ClassVar, Literal

from pydantic import Field

from aug3d_core.heads.config import HeadConfig

TOWNS, RANDOM = "towns", "random"  # first weights that are no file
SHIPPED_FEATURES = 16  # what it can be taken for
SHIPPED = Path(__file__).with_name("towns")  # a trained head as the stage training writes it: docs/weights.md
SHIPPED_DIGEST = "7e3a97385390ff5c994bbff485d138a1e179197732f8841874f0241d7866ed77"  # SHA-256 of its weights


class SweepConfig(HeadConfig):
    """The cost volumes, and what of a target a step looks at."""

    title: ClassVar[str] = "plane sweep"
    decidable: ClassVar[tuple[str, ...]] = ("planes",)
    of_training: ClassVar[tuple[str, ...]] = (
        "crop_px",
        "depth_weight",
        "start",
        "start_share",
        "recoloured_share",
        "other_cameras_share",
    )
    name: Literal["sweep"] = Field(default="sweep", description="Name of the head.")
    planes: int = Field(default=32, ge=4, le=256, description="Planes of the coarse volume, over the slab [planes].")
    fine_planes: int = Field(
        default=7, ge=3, le=32, description="Planes of the fine volume, about the coarse height [planes]."
    )
    features: int = Field(default=16, ge=4, le=128, description="Channels of the coarse features [channels].")
    crop_px: int = Field(
        default=128,
        ge=32,
        le=4096,
        description="Width of the part of a target in a training step; it is 3/4 as high [px].",
    )
    depth_weight: float = Field(
        default=0.5, ge=0, le=100, description="Weight of the error of height in the slab, where depth is known [1]."
    )

    start: str = Field(
        default=TOWNS,
        min_length=1,
        description="First weights: towns (shipped; trained on made-up towns alone; they fit 16 features, others start at"
        " random), random (needs more steps, faster), or a file model.safetensors of a plane sweep.",
    )
    start_share: float = Field(
        default=0.5,
        ge=0,
        lt=1,
        description="Share of the first weights in the finished model, which is the weighted mean of first and trained weights"
        " [share]. The model keeps more of what it knew. 0: the trained weights alone. Random first weights never count.",
    )
    recoloured_share: float = Field(
        default=0.25,
        ge=0,
        le=1,
        description="Share of the training steps that see everything in other colours: better on places never seen, worse on"
        " this one [share].",
    )
    other_cameras_share: float = Field(
        default=0.0,
        ge=0,
        le=1,
        description="Share of the training steps that see everything as other cameras might have photographed it (contrast,"
        " tint, blur, noise): for a model that is trained on renders alone [share].",
    )
    scaffold: bool = Field(
        default=True,
        description="Start from the depth of the scene's mesh, made without the target, where there is one.",
    )

    @property
    def facts(self) -> Mapping[str, int | float | str]:
        """The size of the network."""
        return {"planes": self.planes, "features": self.features, "crop": f"{self.crop_px} px", "start": self.start}

    @property
    def fitting_start(self) -> str:
        """What training starts from: `start`, but random weights where the shipped ones do not fit."""
        return RANDOM if self.start == TOWNS and self.features != SHIPPED_FEATURES else self.start

    @property
    def files(self) -> tuple[Path, ...]:
        """The file of the first weights, where one is named."""
        return () if self.start in (TOWNS, RANDOM) else (Path(self.start).expanduser(),)


CONFIG = SweepConfig
PRESETS: Mapping[str, Mapping[str, Any]] = {
    "tiny": {
        # More on one scene costs what the towns taught: docs/measured.md; faster, too: docs/trials.md
        "steps": 100,
        "learning_rate": 5e-4,
        "warmup_steps": 5,
        "least_gain_db": 0.0,  # a probe costs as much as a step
        "rendered_share": 0.6,
        "groups_per_step": 1,
        "input_views": 5,
        "head": SweepConfig(),
    },
    "small": {
        "steps": 12_000,
        "learning_rate": 2e-3,
        "rendered_share": 0.6,
        "input_views": 5,
        "head": SweepConfig(planes=64, features=24, crop_px=192, start=RANDOM),
    },
    "paper": {
        "steps": 100_000,
        "learning_rate": 1e-3,
        "rendered_share": 0.6,
        "groups_per_step": 4,
        "input_views": 7,
        "checkpoint_every": 2000,
        "head": SweepConfig(planes=128, features=32, crop_px=320, start=RANDOM),
    },
}
