"""Settings of PixelNeRF, and how it is trained in each preset. The presets differ from the paper's network field by field."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any, ClassVar, Literal

from pydantic import Field

from aug3d_core.heads.config import HeadConfig

AUTO, RANDOM = "auto", "random"


class PixelNerfConfig(HeadConfig):
    """The network, and the rays that it looks along."""

    title: ClassVar[str] = "PixelNeRF"
    decidable: ClassVar[tuple[str, ...]] = (
        "encoder_channels",
        "hidden",
        "coarse_samples",
        "fine_samples",
        "depth_samples",
    )
    name: Literal["pixelnerf"] = Field(default="pixelnerf", description="Name of the head.")
    rays_per_group: int = Field(
        default=256, ge=1, le=65536, description="Rays of each group in a training step [rays]."
    )
    # The network
    encoder: Literal["small", "resnet34"] = Field(
        default="small", description="Convolutional encoder of the input views."
    )
    encoder_channels: int = Field(
        default=24, ge=4, le=512, description="Channels of the first map of the small encoder [channels]."
    )
    encoder_weights: str = Field(
        default=RANDOM,
        description="First weights of resnet34: `random`, `auto` (ImageNet's if they are available), or a file.",
    )
    encoder_frozen: bool = Field(default=False, description="Do not train the encoder.")
    hidden: int = Field(default=64, ge=8, le=1024, description="Width of the field's layers [units].")
    blocks_per_view: int = Field(
        default=3, ge=1, le=8, description="Residual blocks before views are averaged [blocks]."
    )
    blocks_pooled: int = Field(default=2, ge=1, le=8, description="Residual blocks after views are averaged [blocks].")
    frequencies: int = Field(default=6, ge=0, le=16, description="Octaves of the positional encoding [octaves].")
    normalised_z: bool = Field(
        default=False, description="Encode points rotated into a view's frame, but not moved there."
    )
    see_pixels: bool = Field(
        default=True,
        description="Give the field the input's colour where a point projects, and the angle between the two rays.",
    )
    even_exposure: bool = Field(
        default=True,
        description="Show the network every group at one brightness and contrast, whatever its photographs' exposure.",
    )
    mask_unseen: bool = Field(default=True, description="Leave out views that do not see a point.")
    blend_inputs: bool = Field(
        default=True, description="Colour is a weighted blend of the input pixels plus what the network adds."
    )
    encode_height: bool = Field(default=True, description="Give the field the height of a point in the slab.")
    density: Literal["relu", "softplus"] = Field(
        default="softplus",
        description="How density is kept positive: relu, as in the paper, or softplus, which starts thin and cannot die.",
    )
    # Where along a ray
    slab_bounds: bool = Field(default=True, description="Cut each ray to the layer between ground and roofs.")
    opaque_end: bool = Field(
        default=True, description="Let the last sample of a ray stop all light: below it is the ground."
    )
    coarse_samples: int = Field(default=8, ge=2, le=512, description="Stratified samples on a ray [samples].")
    fine_samples: int = Field(
        default=4, ge=0, le=512, description="Samples where the coarse network saw matter [samples]."
    )
    depth_samples: int = Field(default=2, ge=0, le=512, description="Samples around the coarse depth [samples].")

    @property
    def pixels_per_group(self) -> int:
        """A ray is a pixel of a target."""
        return self.rays_per_group

    @property
    def facts(self) -> Mapping[str, int | float | str]:
        """The size of the network."""
        return {"rays a group": self.rays_per_group, "hidden units": self.hidden, "encoder": self.encoder}

    @property
    def files(self) -> tuple[Path, ...]:
        """The weights that the encoder starts from, where they are a file."""
        if self.encoder == "small" or self.encoder_weights in (AUTO, RANDOM):
            return ()
        return (Path(self.encoder_weights).expanduser(),)


CONFIG = PixelNerfConfig
PRESETS: Mapping[str, Mapping[str, Any]] = {
    "tiny": {"head": PixelNerfConfig()},
    "small": {
        "steps": 12_000,
        "head": PixelNerfConfig(encoder_channels=32, coarse_samples=16, fine_samples=8, depth_samples=4),
    },
    "paper": {
        "groups_per_step": 4,
        "steps": 400_000,
        "learning_rate": 1e-4,
        "final_rate_share": 1.0,
        "warmup_steps": 0,
        "max_gradient_norm": 0,
        "least_gain_db": 0,
        "checkpoint_every": 2000,
        "head": PixelNerfConfig(
            rays_per_group=128,
            encoder="resnet34",
            encoder_weights=AUTO,
            encoder_frozen=True,
            hidden=256,
            normalised_z=True,
            see_pixels=False,
            even_exposure=False,
            mask_unseen=False,
            blend_inputs=False,
            encode_height=False,
            density="relu",
            slab_bounds=False,
            opaque_end=False,
            coarse_samples=64,
            fine_samples=16,
            depth_samples=16,
        ),
    },
}
