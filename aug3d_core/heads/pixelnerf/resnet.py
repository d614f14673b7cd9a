"""The part of ResNet-34 (He et al. 2016) that pixelNeRF uses, with torchvision's names, so that its weights fit."""

from __future__ import annotations

from jaxtyping import Float
from torch import Tensor, nn
from torch.nn import functional as F

STAGES = ((64, 3), (128, 4), (256, 6))  # channels and blocks of layer1, layer2, layer3; layer4 and fc are not used


class BasicBlock(nn.Module):
    """Two 3x3 convolutions around a skip, which is a 1x1 convolution where size or channels change."""

    def __init__(self, channels_in: int, channels: int, stride: int) -> None:
        super().__init__()
        self.conv1 = nn.Conv2d(channels_in, channels, 3, stride, 1, bias=False)
        self.bn1 = nn.BatchNorm2d(channels)
        self.conv2 = nn.Conv2d(channels, channels, 3, 1, 1, bias=False)
        self.bn2 = nn.BatchNorm2d(channels)
        self.downsample: nn.Module = nn.Identity()
        if stride != 1 or channels_in != channels:
            self.downsample = nn.Sequential(
                nn.Conv2d(channels_in, channels, 1, stride, bias=False), nn.BatchNorm2d(channels)
            )

    def forward(self, maps: Float[Tensor, "b c h w"]) -> Float[Tensor, "b c2 h2 w2"]:
        """Add what the convolutions find."""
        found = self.bn2(self.conv2(F.relu(self.bn1(self.conv1(maps)))))
        return F.relu(found + self.downsample(maps))


class ResNet34(nn.Module):
    """Up to and with the third stage."""

    def __init__(self) -> None:
        super().__init__()
        self.conv1 = nn.Conv2d(3, 64, 7, 2, 3, bias=False)
        self.bn1 = nn.BatchNorm2d(64)
        before = 64
        for number, (channels, blocks) in enumerate(STAGES, 1):
            first = BasicBlock(before, channels, 1 if number == 1 else 2)
            self.add_module(
                f"layer{number}", nn.Sequential(first, *(BasicBlock(channels, channels, 1) for _ in range(blocks - 1)))
            )
            before = channels
        for module in self.modules():
            if isinstance(module, nn.Conv2d):
                nn.init.kaiming_normal_(module.weight, mode="fan_out", nonlinearity="relu")

    def forward(self, images: Float[Tensor, "b 3 h w"]) -> list[Float[Tensor, "b c h2 w2"]]:
        """Return the maps of the first convolution and of the three stages, finest first."""
        maps = F.relu(self.bn1(self.conv1(images)))
        found = [maps]
        maps = F.max_pool2d(maps, 3, stride=2, padding=1)
        for number in range(1, len(STAGES) + 1):
            maps = self.get_submodule(f"layer{number}")(maps)
            found.append(maps)
        return found


def used_weights(weights: dict[str, Tensor]) -> dict[str, Tensor]:
    """Return those of a file of torchvision's ResNet-34 that this part of it has."""
    return {name: value for name, value in weights.items() if not name.startswith(("layer4.", "fc."))}
