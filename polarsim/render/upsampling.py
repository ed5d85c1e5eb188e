"""Smooth light known at every so many-th pixel, brought to all of them without crossing edges.

Joint bilateral upsampling (Kopf et al., ACM Trans. Graph. 26 (2007) 96): a pixel takes the light of those about it that
lie in its plane and face its way. What is averaged is the light vector and how much of it is sent on, so that a pixel
is lit by its own normal: light of walls comes from low above the horizon, and each ripple of sand shows in it.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass

import numpy as np

from polarsim.geometry.lens import HALF_PIXEL
from polarsim.geometry.vectors import dot
from polarsim.render.hits import Hits

_LEAST_LIKE = np.float32(0.1)  # weight of all neighbours together, of 1, below which they do not tell
_POWER = 2  # squarings of the cosine between two normals: its 4th power, one half at 33 degrees
_FROM_BEHIND = np.float32(0.1)  # least irradiance, of the light vector's length: light does not all come from one side
_AROUND = tuple(itertools.product((-1, 0, 1), repeat=2))


@dataclass(frozen=True)
class Grid:
    """Points at every `step`-th pixel, and light there."""

    step: int
    seen: np.ndarray  # (h, w) bool: a surface is there
    point: np.ndarray  # (h, w, 3) float32, metres
    normal: np.ndarray  # (h, w, 3) float32, unit
    thickness: np.ndarray  # (h, w) float32: points so far off its plane are hardly alike, metres
    share: np.ndarray  # (k, h, w) float32: radiance sent to the viewer over irradiance, of k kinds of light
    vector: np.ndarray  # (k, 3, h, w) float32: light vector

    @classmethod
    def smoothed(
        cls,
        step: int,
        seen: np.ndarray,
        point: np.ndarray,
        normal: np.ndarray,
        thickness: np.ndarray,
        sent: np.ndarray,
        vector: np.ndarray,
    ) -> Grid:
        """From noisy light, radiance `sent` (k, h, w) and light vectors, averaged over alike neighbours."""
        weights = [_weights_beside(seen, point, normal, thickness, *offset) for offset in _AROUND]
        vector = _averaged(vector, weights)
        arriving = irradiance(vector, normal)
        share = np.divide(sent, arriving, out=np.zeros_like(sent), where=arriving > 0)
        return cls(step, seen, point, normal, thickness, _averaged(share, weights), vector)

    def at(self, hits: Hits, width: int, offset: tuple[float, float]) -> tuple[np.ndarray, np.ndarray]:
        """Light (k, n) that the hits (n,) of pixels of a photo `width` wide, moved by `offset` pixels, send.

        Also numbers (m,) of those that are like none of their four neighbours: their light is 0.
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
            near = (1 - np.abs(y - top - down)) * (1 - np.abs(x - left - right)) * self.seen[at]
            alike = likeness(hits.point, hits.normal, self.thickness[at], self.point[at], self.normal[at])
            weight = (near * alike).astype(np.float32)
            share += weight * self.share[:, *at]
            vector += weight * self.vector[:, :, *at]
            weights += weight
        known = weights > _LEAST_LIKE
        whole = np.where(known, weights, np.float32(1))
        light = share / whole * irradiance(vector / whole, hits.normal)
        light[:, ~known] = 0
        return light, np.flatnonzero(~known)


def irradiance(vector: np.ndarray, normal: np.ndarray) -> np.ndarray:
    """(k, ...) of surfaces with unit normals (..., 3) under light vectors (k, 3, ...)."""
    x, y, z = vector[:, 0], vector[:, 1], vector[:, 2]
    along = x * normal[..., 0] + y * normal[..., 1] + z * normal[..., 2]
    return np.asarray(np.maximum(along, _FROM_BEHIND * np.sqrt(x * x + y * y + z * z)))


def likeness(
    point: np.ndarray, normal: np.ndarray, thickness: np.ndarray, other: np.ndarray, other_normal: np.ndarray
) -> np.ndarray:
    """(n,) weights 0 to 1 of other points (n, 3): 1 in the same plane with the same normal."""
    weight = np.maximum(dot(normal, other_normal), np.float32(0))
    for _ in range(_POWER):
        weight = weight * weight
    off = dot(other - point, normal) / np.where(thickness > 0, thickness, np.float32(1))
    return np.asarray(weight * np.exp(-off * off))


def _weights_beside(
    seen: np.ndarray, point: np.ndarray, normal: np.ndarray, thickness: np.ndarray, down: int, right: int
) -> np.ndarray:
    """(h, w) likeness of each point to the one so far down and right; 0 where there is none."""
    own, other = _overlap(seen.shape, down, right)
    weight = np.zeros(seen.shape, np.float32)
    both = seen[own] & seen[other]
    pairs = [picture[own][both] for picture in (point, normal, thickness)]
    weight[own][both] = likeness(pairs[0], pairs[1], pairs[2], point[other][both], normal[other][both])
    return weight


def _averaged(pictures: np.ndarray, weights: list[np.ndarray]) -> np.ndarray:
    """Pictures (..., h, w), each point the mean of those around it by their weights, in the order of `_AROUND`."""
    total = np.zeros_like(pictures)
    for weight, offset in zip(weights, _AROUND, strict=True):
        own, other = _overlap(weight.shape, *offset)
        total[..., *own] += weight[own] * pictures[..., *other]
    whole = sum(weights, np.zeros_like(weights[0]))
    return np.asarray(np.divide(total, whole, out=np.zeros_like(total), where=whole > 0))


def _overlap(shape: tuple[int, ...], down: int, right: int) -> tuple[tuple[slice, slice], tuple[slice, slice]]:
    """The part of a picture that has neighbours so far down and right, and these neighbours."""
    own, other = [], []
    for size, offset in zip(shape, (down, right), strict=True):
        own.append(slice(max(0, -offset), size - max(0, offset)))
        other.append(slice(max(0, offset), size - max(0, -offset)))
    return (own[0], own[1]), (other[0], other[1])
