"""Smooth light known at every so many-th pixel, brought to all of them without crossing edges.

Joint bilateral upsampling (Kopf et al., ACM Trans. Graph. 26 (2007) 96): a pixel takes the light of those about it that
lie in its plane and face its way.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass

import numpy as np

from polarsim.geometry.lens import HALF_PIXEL
from polarsim.render.hits import Hits, dot

_LEAST_LIKE = np.float32(0.1)  # weight of all neighbours together, of 1, below which they do not tell
_POWER = 3  # squarings of the cosine between two normals: its 8th power, one half at 23 degrees


@dataclass(frozen=True)
class Grid:
    """Places at every `step`-th pixel, and light there."""

    step: int
    seen: np.ndarray  # (h, w) bool: a surface is there
    point: np.ndarray  # (h, w, 3) float32, metres
    normal: np.ndarray  # (h, w, 3) float32, unit
    thickness: np.ndarray  # (h, w) float32: points so far off its plane are hardly alike, metres
    light: np.ndarray  # (k, h, w) float32, of k kinds

    def smoothed(self) -> Grid:
        """Light averaged over alike neighbours, eight at most."""
        total, weights = np.zeros_like(self.light), np.zeros(self.seen.shape, np.float32)
        for down, right in itertools.product((-1, 0, 1), repeat=2):
            own, other = _overlap(self.seen.shape, down, right)
            weight = np.zeros(self.seen[own].shape, np.float32)
            both = self.seen[own] & self.seen[other]
            point, normal, thickness = (picture[own][both] for picture in (self.point, self.normal, self.thickness))
            weight[both] = likeness(point, normal, thickness, self.point[other][both], self.normal[other][both])
            total[:, *own] += weight * self.light[:, *other]
            weights[own] += weight
        light = np.divide(total, weights, out=np.zeros_like(total), where=weights > 0)
        return Grid(self.step, self.seen, self.point, self.normal, self.thickness, light)

    def at(self, hits: Hits, width: int, offset: tuple[float, float]) -> tuple[np.ndarray, np.ndarray]:
        """Light (k, n) at the hits (n,) of pixels of a photo `width` wide, moved by `offset` pixels.

        Also numbers (m,) of those that are like none of their four neighbours: their light is 0.
        """
        row, column = np.divmod(hits.pixel, width)
        x = (column + HALF_PIXEL + offset[0]) / self.step - HALF_PIXEL
        y = (row + hits.rows.start + HALF_PIXEL + offset[1]) / self.step - HALF_PIXEL
        left, top = np.floor(x).astype(int), np.floor(y).astype(int)
        total, weights = np.zeros((len(self.light), len(row)), np.float32), np.zeros(len(row), np.float32)
        high, wide = self.seen.shape
        for down, right in itertools.product((0, 1), repeat=2):
            at = (np.clip(top + down, 0, high - 1), np.clip(left + right, 0, wide - 1))
            share = (1 - np.abs(y - top - down)) * (1 - np.abs(x - left - right)) * self.seen[at]
            alike = likeness(hits.point, hits.normal, self.thickness[at], self.point[at], self.normal[at])
            weight = (share * alike).astype(np.float32)
            total += weight * self.light[:, *at]
            weights += weight
        known = weights > _LEAST_LIKE
        return np.divide(total, weights, out=np.zeros_like(total), where=known), np.flatnonzero(~known)


def likeness(
    point: np.ndarray, normal: np.ndarray, thickness: np.ndarray, other: np.ndarray, other_normal: np.ndarray
) -> np.ndarray:
    """(n,) weights 0 to 1 of other points (n, 3): 1 in the same plane with the same normal."""
    weight = np.maximum(dot(normal, other_normal), np.float32(0))
    for _ in range(_POWER):
        weight = weight * weight
    off = dot(other - point, normal) / np.where(thickness > 0, thickness, np.float32(1))
    return np.asarray(weight * np.exp(-off * off))


def _overlap(shape: tuple[int, ...], down: int, right: int) -> tuple[tuple[slice, slice], tuple[slice, slice]]:
    """The part of a picture that has neighbours so far down and right, and these neighbours."""
    own, other = [], []
    for size, shift in zip(shape, (down, right), strict=True):
        own.append(slice(max(0, -shift), size - max(0, shift)))
        other.append(slice(max(0, shift), size - max(0, -shift)))
    return (own[0], own[1]), (other[0], other[1])
