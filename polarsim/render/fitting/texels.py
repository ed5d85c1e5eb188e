"""Albedo of every vertex and brightness of every lamp from samples, by robust alternating least squares.

A texel is the neighbourhood of a vertex: samples contribute to the corners of their triangle by barycentric weights.
For each texel, view and lamp, the sum of the photo light divided by the sum of the model light is one observation. Sums
are used because sand grains that face towards the lamp and away from it cancel out in a sum but not in a mean of
logarithms. The logarithm of an observation is the logarithm of the lamp brightness plus that of the albedo. Residuals
are weighted by the scatter of their lamp and by the Cauchy function. Weak priors on differences between neighbours and
from the mean of the object ensure that every vertex has an albedo.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import sparse

from polarsim.photo import NO_ROCK
from polarsim.render.fitting.samples import FitSamples

# Typical relative difference of the albedos of two neighbouring vertices, and of an albedo from the object mean.
_SMOOTHNESS, _SPREAD = 0.05, 0.3
_ROUNDS = 12
_MIN_SCATTER = 0.03  # minimum scatter of the residuals of a lamp
_CAUCHY_SCALE = 2.5  # scale of the Cauchy weight, in units of the scatter
_MIN_COUNT = 0.5  # minimum sum of the barycentric weights of an observation
_HALF_COUNT = 2.0  # sum of weights at which an observation has half of the maximum weight
_MIN_OBSERVATIONS = 30  # minimum number of observations for the mean of a rock
_STEPS, _CLOSE = 200, 1e-5  # maximum steps and relative tolerance of conjugate gradients


@dataclass(frozen=True)
class Texels:
    """Observations (n) of texels."""

    vertex: np.ndarray  # (n,) int32
    lamp: np.ndarray  # (n,) int16
    ratio: np.ndarray  # (n,) logarithm of photo light over model light
    count: np.ndarray  # (n,) sum of the weights of the samples

    def part(self, chosen: np.ndarray) -> Texels:
        return Texels(self.vertex[chosen], self.lamp[chosen], self.ratio[chosen], self.count[chosen])


@dataclass(frozen=True)
class Solution:
    """Solution of the fit, natural logarithms."""

    albedo: np.ndarray  # (v,) median of the ground is 0
    lamps: dict[int, float]  # DN per ms per unit radiance, for observed lamps
    rocks: dict[int, float]  # mean albedo of each rock


def texels_of(samples: FitSamples, radiance: np.ndarray, faces: np.ndarray) -> Texels:
    """Group samples (n,) with radiance (n,) at unit albedo into observations; `faces` (f, 3) are vertex numbers."""
    groups = []
    group = samples.lamp.astype(np.int64) * (int(samples.view.max(initial=0)) + 1) + samples.view
    for number in np.unique(group):
        chosen = np.flatnonzero(group == number)
        corners = faces.take(samples.face.take(chosen), axis=0)
        second, third = samples.weights[chosen].T.astype(float)
        weight = np.stack([1 - second - third, second, third], axis=1)
        vertex, texel = np.unique(corners, return_inverse=True)
        texel = texel.ravel()

        def summed(values: np.ndarray, weight: np.ndarray = weight, texel: np.ndarray = texel) -> np.ndarray:
            return np.bincount(texel, (weight * values[:, None]).ravel())

        light, model, count = summed(samples.rate[chosen]), summed(radiance[chosen]), summed(np.ones(len(chosen)))
        good = (count > _MIN_COUNT) & (light > 0) & (model > 0)
        lamp = np.full(good.sum(), samples.lamp[chosen[0]])
        groups.append((vertex[good].astype(np.int32), lamp, np.log(light[good] / model[good]), count[good]))
    if not groups:
        return Texels(np.zeros(0, np.int32), np.zeros(0, np.int16), np.zeros(0), np.zeros(0))
    return Texels(*(np.concatenate(parts) for parts in zip(*groups, strict=True)))


def solve(texels: Texels, faces: np.ndarray, rock_of_vertex: np.ndarray) -> Solution:
    """Fit albedos and lamp brightness to the observations.

    `faces` (f, 3): triangles of all objects; objects share no vertices. `rock_of_vertex` (v,): rock of each vertex,
    `NO_ROCK` for the ground.
    """
    count = len(rock_of_vertex)
    lamps = np.unique(texels.lamp)
    index = np.searchsorted(lamps, texels.lamp)
    gains = np.array([np.median(texels.ratio[index == number]) for number in range(len(lamps))])
    smoothing, neighbours = _smoothing(faces, count, _SMOOTHNESS)
    pull = 1 / _SPREAD**2
    albedo, means = np.zeros(count), np.zeros(count)
    observations = np.bincount(texels.vertex, minlength=count)
    rocks: dict[int, float] = {}
    for _ in range(_ROUNDS if len(texels.ratio) else 0):
        residual = texels.ratio - gains[index] - albedo[texels.vertex]
        weight = _weights(residual, index, len(lamps), texels.count)
        gains += np.bincount(index, weight * residual, len(lamps)) / np.bincount(index, weight, len(lamps))
        towards = np.bincount(texels.vertex, weight * (texels.ratio - gains[index]), count) + pull * means
        diagonal = np.bincount(texels.vertex, weight, count) + pull
        albedo = conjugate_gradients(smoothing, diagonal, diagonal + neighbours, towards, albedo)
        rocks, means = _means(albedo, observations, rock_of_vertex)
        ground = (rock_of_vertex == NO_ROCK) & (observations > 0)
        level = float(np.median(albedo[ground if ground.any() else observations > 0]))
        albedo, means, gains = albedo - level, means - level, gains + level
        rocks = {rock: mean - level for rock, mean in rocks.items()}
    if not rocks:
        rocks, _ = _means(albedo, observations, rock_of_vertex)
    return Solution(albedo, dict(zip(lamps.tolist(), gains.tolist(), strict=True)), rocks)


def conjugate_gradients(
    matrix: sparse.csr_array, diagonal: np.ndarray, whole_diagonal: np.ndarray, towards: np.ndarray, start: np.ndarray
) -> np.ndarray:
    """Solve (matrix + diagonal) x = towards for x, from `start`, with a Jacobi preconditioner (`whole_diagonal`).

    Sums use NumPy instead of BLAS, because the results of BLAS depend on the number of threads.
    """
    x = start.copy()
    residual = towards - (matrix @ x + diagonal * x)
    ahead = scaled = residual / whole_diagonal
    size = float((residual * scaled).sum())
    goal = _CLOSE**2 * float((towards * towards / whole_diagonal).sum())
    for _ in range(_STEPS):
        if size <= goal:
            break
        moved = matrix @ ahead + diagonal * ahead
        step = size / float((ahead * moved).sum())
        x = x + step * ahead
        residual = residual - step * moved
        scaled = residual / whole_diagonal
        size, before = float((residual * scaled).sum()), size
        ahead = scaled + size / before * ahead
    return x


def _weights(residual: np.ndarray, index: np.ndarray, lamps: int, count: np.ndarray) -> np.ndarray:
    scatter = np.array([1.4826 * np.median(np.abs(residual[index == number])) for number in range(lamps)])
    scatter = np.maximum(scatter, _MIN_SCATTER)[index]
    cauchy = 1 + (residual / (_CAUCHY_SCALE * scatter)) ** 2
    return np.asarray(count / (count + _HALF_COUNT) / scatter**2 / cauchy)


def _smoothing(faces: np.ndarray, count: int, difference: float) -> tuple[sparse.csr_array, np.ndarray]:
    """Return the graph Laplacian of a mesh over the squared typical difference of neighbours, and the diagonal."""
    edges = np.unique(np.sort(faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1), axis=0)
    first, second = edges.T
    value = 1 / difference**2
    diagonal = value * np.bincount(edges.ravel(), minlength=count).astype(float)
    rows = np.concatenate([first, second, np.arange(count)])
    columns = np.concatenate([second, first, np.arange(count)])
    values = np.concatenate([np.full(2 * len(edges), -value), diagonal])
    return sparse.csr_array((values, (rows, columns)), shape=(count, count)), diagonal


def _means(
    albedo: np.ndarray, observations: np.ndarray, rock_of_vertex: np.ndarray
) -> tuple[dict[int, float], np.ndarray]:
    """Return the mean albedo of every rock, weighted by observations, and the mean of the object of each vertex (v,).

    Rocks with few observations get the mean of all other rocks.
    """
    _, index = np.unique(rock_of_vertex, return_inverse=True)
    count, total = np.bincount(index, observations), np.bincount(index, observations * albedo)
    names = np.unique(rock_of_vertex)
    enough = count >= _MIN_OBSERVATIONS
    is_rock = names != NO_ROCK
    usual = float(np.mean(total[enough & is_rock] / count[enough & is_rock])) if (enough & is_rock).any() else 0.0
    means = np.where(enough, total / np.maximum(count, 1), np.where(is_rock, usual, 0.0))
    rocks = {int(name): float(mean) for name, mean in zip(names, means, strict=True) if name != NO_ROCK}
    return rocks, means[index]
