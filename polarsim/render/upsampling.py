"""Upsampling of smooth light from a coarse pixel grid to all pixels, without crossing edges.

Joint bilateral upsampling (Kopf et al., ACM Trans. Graph. 26 (2007) 96): the light of a pixel is the mean over coarse
pixels nearby that are in the same plane and have a similar normal. The light vector and the reflected share are
averaged separately, so that each pixel is lit according to its normal: the light of the walls arrives at low
elevation, and therefore ripples of the sand are visible in it.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass

import numpy as np

from polarsim.geometry.lens import HALF_PIXEL
from polarsim.geometry.vectors import dot
from polarsim.render.hits import Hits

_MIN_WEIGHT = np.float32(0.1)  # minimum total weight of the four neighbours; 1 is the maximum
_POWER = 2  # squarings of the cosine between two normals: 4th power, 0.5 at 33 degrees
_FROM_BEHIND = np.float32(0.1)  # minimum irradiance over the length of the light vector, for light from other sides
_AROUND = tuple(itertools.product((-1, 0, 1), repeat=2))


@dataclass(frozen=True)
class LightGrid:
    """Surface points and light at every `step`-th pixel."""

    step: int
    hit: np.ndarray  # (h, w) bool: pixels with a surface
    point: np.ndarray  # (h, w, 3) float32, metres
    normal: np.ndarray  # (h, w, 3) float32, unit
    thickness: np.ndarray  # (h, w) float32: distance from the plane at which the similarity drops to 1/e, metres
    share: np.ndarray  # (k, h, w) float32: radiance sent to the viewer over irradiance, of k kinds of light
    vector: np.ndarray  # (k, 3, h, w) float32: light vector

    @classmethod
    def smoothed(
        cls,
        step: int,
        hit: np.ndarray,
        point: np.ndarray,
        normal: np.ndarray,
        thickness: np.ndarray,
        sent: np.ndarray,
        vector: np.ndarray,
    ) -> LightGrid:
        """Build the grid from noisy radiance `sent` (k, h, w) and light vectors, averaged over similar neighbours."""
        weights = [_neighbour_weights(hit, point, normal, thickness, *offset) for offset in _AROUND]
        vector = _averaged(vector, weights)
        arriving = irradiance(vector, normal)
        share = np.divide(sent, arriving, out=np.zeros_like(sent), where=arriving > 0)
        return cls(step, hit, point, normal, thickness, _averaged(share, weights), vector)

    def at(self, hits: Hits, width: int, offset: tuple[float, float]) -> tuple[np.ndarray, np.ndarray]:
        """Return the radiance (k, n) of the hits (n,) and the numbers (m,) of hits without light from the grid.

        The hits belong to an image `width` pixels wide; rays are `offset` pixels from pixel centres. Hits without a
        similar neighbour among the four nearest grid pixels have light 0 and are listed.
        """
        row, column = np.divmod(hits.pixel, width)
        x = (column + HALF_PIXEL + offset[0]) / self.step - HALF_PIXEL
        y = (row + hits.rows.start + HALF_PIXEL + offset[1]) / self.step - HALF_PIXEL
        left, top = np.floor(x).astype(int), np.floor(y).astype(int)
        kinds, high, wide = self.share.shape
        share, vector = np.zeros((kinds, len(row)), np.float32), np.zeros((kinds, 3, len(row)), np.float32)
        weights = np.zeros(len(row), np.float32)
        for down, right in itertools.product((0, 1), repeat=2):
            at = (np.clip(top + down, 0, high - 1), np.clip(left + right, 0, wide - 1))
            near = (1 - np.abs(y - top - down)) * (1 - np.abs(x - left - right)) * self.hit[at]
            similar = _similarity(hits.point, hits.normal, self.thickness[at], self.point[at], self.normal[at])
            weight = (near * similar).astype(np.float32)
            share += weight * self.share[:, *at]
            vector += weight * self.vector[:, :, *at]
            weights += weight
        defined = weights > _MIN_WEIGHT
        total = np.where(defined, weights, np.float32(1))
        light = share / total * irradiance(vector / total, hits.normal)
        light[:, ~defined] = 0
        return light, np.flatnonzero(~defined)


def irradiance(vector: np.ndarray, normal: np.ndarray) -> np.ndarray:
    """Return the irradiance (k, ...) of surfaces with unit normals (..., 3) under light vectors (k, 3, ...)."""
    x, y, z = vector[:, 0], vector[:, 1], vector[:, 2]
    along = x * normal[..., 0] + y * normal[..., 1] + z * normal[..., 2]
    return np.asarray(np.maximum(along, _FROM_BEHIND * np.sqrt(x * x + y * y + z * z)))


def _similarity(
    point: np.ndarray, normal: np.ndarray, thickness: np.ndarray, other: np.ndarray, other_normal: np.ndarray
) -> np.ndarray:
    """Return the similarity (n,), 0 to 1, of points and other points (n, 3): 1 for the same plane and normal."""
    weight = np.maximum(dot(normal, other_normal), np.float32(0))
    for _ in range(_POWER):
        weight = weight * weight
    off = dot(other - point, normal) / np.where(thickness > 0, thickness, np.float32(1))
    return np.asarray(weight * np.exp(-off * off))


def _neighbour_weights(
    hit: np.ndarray, point: np.ndarray, normal: np.ndarray, thickness: np.ndarray, down: int, right: int
) -> np.ndarray:
    """Return the similarity (h, w) of each point to the neighbour at an offset `down`, `right`; 0 without neighbour."""
    base, other = _overlap(hit.shape, down, right)
    weight = np.zeros(hit.shape, np.float32)
    both = hit[base] & hit[other]
    pairs = [array[base][both] for array in (point, normal, thickness)]
    weight[base][both] = _similarity(pairs[0], pairs[1], pairs[2], point[other][both], normal[other][both])
    return weight


def _averaged(images: np.ndarray, weights: list[np.ndarray]) -> np.ndarray:
    """Return images (..., h, w) averaged over neighbours, with weights (h, w) in the order of `_AROUND`."""
    total = np.zeros_like(images)
    for weight, offset in zip(weights, _AROUND, strict=True):
        base, other = _overlap(weight.shape, *offset)
        total[..., *base] += weight[base] * images[..., *other]
    weight_sum = sum(weights, np.zeros_like(weights[0]))
    return np.asarray(np.divide(total, weight_sum, out=np.zeros_like(total), where=weight_sum > 0))


def _overlap(shape: tuple[int, ...], down: int, right: int) -> tuple[tuple[slice, slice], tuple[slice, slice]]:
    """Return the slices of the pixels that have a neighbour at an offset `down`, `right`, and of these neighbours."""
    base, other = [], []
    for size, offset in zip(shape, (down, right), strict=True):
        base.append(slice(max(0, -offset), size - max(0, offset)))
        other.append(slice(max(0, offset), size - max(0, -offset)))
    return (base[0], base[1]), (other[0], other[1])
