"""The network: a small residual trunk to stride 32, a pyramid back to stride 4, one dense head there.

Half of all rocks are under ten pixels wide at the picture sizes that a CPU can train on, so there is one fine map
instead of three coarse ones (cf. Zhou et al., Objects as Points, arXiv 1904.07850), and every class has a box of its
own at a cell, since a rock and its shadow touch (cf. Tian et al., FCOS, ICCV 2019).
"""

from __future__ import annotations

import math
from itertools import pairwise
from typing import cast

import torch
from torch import Tensor, nn
from torch.nn import functional

STRIDE = 4  # px of the picture a cell of the head's map
WIDTHS = {"compact": (16, 32, 64, 96, 128), "compact-l": (32, 64, 128, 192, 256)}  # channels at strides 2 to 32
_FIRST_SCORE = 0.01  # of every cell before training: nearly all are empty


class Compact(nn.Module):
    """Scores and boxes of every cell and, with a head for masks, what every cell shows."""

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
        nn.init.constant_(self.score.bias, -math.log((1 - _FIRST_SCORE) / _FIRST_SCORE))
        nn.init.zeros_(self.edges.weight)
        nn.init.constant_(self.edges.bias, math.log(1.5))
        # Drawn last, so that the rest starts alike with a head for masks and without one.
        self.mask = nn.Sequential(_conv(neck, neck), nn.Conv2d(neck, mask_classes, 1)) if mask_classes else None

    def forward(self, pictures: Tensor) -> tuple[Tensor, Tensor]:
        """Logits (b, classes, h, w) and boxes (b, classes, 4, h, w), x0, y0, x1, y1 in px, of pictures (b, 1, H, W).

        Pictures are grey values 0 to 1; H and W are multiples of 32.
        """
        return self.boxes(self.features(pictures))

    def features(self, pictures: Tensor) -> Tensor:
        """What the heads look at, (b, c, h, w) of pictures (b, 1, H, W)."""
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
        """See `forward`."""
        merged = self.tower(features)
        # A distance is an exponential, so that small and large boxes are off by shares of their size.
        distance = self.edges(merged).float().clamp(-4, 6).exp().unflatten(1, (self.classes, 4)) * STRIDE
        return self.score(merged).float(), _boxes(distance)

    def masks(self, features: Tensor) -> Tensor:
        """Logits (b, mask_classes, h, w) of what cells show; for a network with a head for masks."""
        assert self.mask is not None
        return cast("Tensor", self.mask(features)).float()


def cell_centres(height: int, width: int, device: torch.device | str = "cpu") -> tuple[Tensor, Tensor]:
    """Centres x (w,) and y (h,) of the cells of a map, px."""
    x, y = (torch.arange(count, device=device, dtype=torch.float32) for count in (width, height))
    return (x + 0.5) * STRIDE, (y + 0.5) * STRIDE


def _boxes(distance: Tensor) -> Tensor:
    """Corners of distances (b, classes, 4, h, w) left, up, right, down of the cells' centres, px."""
    x, y = cell_centres(distance.shape[-2], distance.shape[-1], distance.device)
    left, up, right, down = distance.unbind(2)
    return torch.stack([x - left, y[:, None] - up, x + right, y[:, None] + down], dim=2)


class _Residual(nn.Module):
    """Two convolutions beside a straight way (He et al., CVPR 2016)."""

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
