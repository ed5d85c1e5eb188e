"""Network: small residual backbone down to stride 32, feature pyramid up to stride 4, one dense head.

At image sizes suitable for training on a CPU, half of all rocks are narrower than ten pixels. So the head has one
fine map instead of three coarse maps (cf. Zhou et al., Objects as Points, arXiv 1904.07850). Because rocks touch their
shadows, each cell predicts a separate box for each class (cf. Tian et al., FCOS, ICCV 2019).
"""

from __future__ import annotations

import math
from itertools import pairwise
from typing import cast

import torch
from torch import Tensor, nn
from torch.nn import functional

STRIDE = 4  # side of a cell of the head, px of the input
WIDTHS = {"compact": (16, 32, 64, 96, 128), "compact-l": (32, 64, 128, 192, 256)}  # channels at strides 2 to 32
_INITIAL_SCORE = 0.01  # initial score of every cell, low because nearly all cells are empty


class Compact(nn.Module):
    """Scores and boxes of every cell, and class masks with the optional mask head."""

    def __init__(self, widths: tuple[int, ...], classes: int, mask_classes: int = 0) -> None:
        super().__init__()
        self.classes = classes
        self.stem = _conv(1, widths[0], stride=2)
        self.stages = nn.ModuleList(
            nn.Sequential(_conv(before, after, stride=2), _Residual(after)) for before, after in pairwise(widths)
        )
        neck = widths[1]
        self.lateral = nn.ModuleList(nn.Conv2d(width, neck, 1) for width in widths[1:])
        self.smooth = nn.ModuleList(_conv(neck, neck) for _ in widths[2:])
        self.tower = nn.Sequential(_conv(neck, neck), _conv(neck, neck))
        self.score = nn.Conv2d(neck, classes, 1)
        self.edges = nn.Conv2d(neck, 4 * classes, 1)
        nn.init.constant_(self.score.bias, -math.log((1 - _INITIAL_SCORE) / _INITIAL_SCORE))
        nn.init.zeros_(self.edges.weight)
        nn.init.constant_(self.edges.bias, math.log(1.5))
        # Created last, so that the initial weights of the other layers do not depend on the mask head.
        self.mask = nn.Sequential(_conv(neck, neck), nn.Conv2d(neck, mask_classes, 1)) if mask_classes else None

    def forward(self, pictures: Tensor) -> tuple[Tensor, Tensor]:
        """Return logits (b, classes, h, w) and boxes (b, classes, 4, h, w), x0, y0, x1, y1 in px.

        Images (b, 1, H, W) have grey values 0 to 1. H and W are multiples of 32.
        """
        return self.boxes(self.features(pictures))

    def features(self, pictures: Tensor) -> Tensor:
        """Return the input features (b, c, h, w) of the heads for images (b, 1, H, W)."""
        levels, value = [], self.stem((pictures - 0.4).mul_(4))
        for stage in self.stages:
            value = stage(value)
            levels.append(value)
        merged = self.lateral[-1](levels[-1])
        for n in range(len(levels) - 2, -1, -1):
            merged = self.lateral[n](levels[n]) + functional.interpolate(merged, scale_factor=2.0, mode="nearest")
            merged = self.smooth[n](merged)
        return cast("Tensor", merged)

    def boxes(self, features: Tensor) -> tuple[Tensor, Tensor]:
        """Return logits and boxes, see `forward`."""
        merged = self.tower(features)
        # Exponential distances make errors proportional to the size of boxes.
        distance = self.edges(merged).float().clamp(-4, 6).exp().unflatten(1, (self.classes, 4)) * STRIDE
        return self.score(merged).float(), _boxes(distance)

    def masks(self, features: Tensor) -> Tensor:
        """Return the mask logits (b, mask_classes, h, w) of cells; requires a mask head."""
        assert self.mask is not None
        return cast("Tensor", self.mask(features)).float()


def cell_centres(height: int, width: int, device: torch.device | str = "cpu") -> tuple[Tensor, Tensor]:
    """Return the centres x (w,) and y (h,) of the cells of a map, px."""
    x, y = (torch.arange(count, device=device, dtype=torch.float32) for count in (width, height))
    return (x + 0.5) * STRIDE, (y + 0.5) * STRIDE


def _boxes(distance: Tensor) -> Tensor:
    """Convert distances (b, classes, 4, h, w) to the left, top, right, bottom from cell centres to corners, px."""
    x, y = cell_centres(distance.shape[-2], distance.shape[-1], distance.device)
    left, up, right, down = distance.unbind(2)
    return torch.stack([x - left, y[:, None] - up, x + right, y[:, None] + down], dim=2)


class _Residual(nn.Module):
    """Residual block of two convolutions (He et al., CVPR 2016)."""

    def __init__(self, width: int) -> None:
        super().__init__()
        self.first = _conv(width, width)
        self.second = nn.Sequential(nn.Conv2d(width, width, 3, padding=1, bias=False), nn.BatchNorm2d(width))

    def forward(self, value: Tensor) -> Tensor:
        return functional.relu(value + self.second(self.first(value)))


def _conv(before: int, after: int, stride: int = 1) -> nn.Sequential:
    return nn.Sequential(
        nn.Conv2d(before, after, 3, stride, padding=1, bias=False), nn.BatchNorm2d(after), nn.ReLU(inplace=True)
    )
