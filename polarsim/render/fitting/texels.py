"""Albedo of every vertex and brightness of every lamp from samples, by robust alternating least squares.

A texel is what lies nearest to a vertex: samples count for the corners of their triangle by barycentric weights. For
each texel, view and lamp the sum of the photo's light over the sum of the model's is one observation; sums, for grains
that face the lamp and grains that face away from it must cancel out, which they do not in a mean of logarithms. Its
logarithm is that of the lamp's brightness plus that of the albedo. Residuals weigh by their lamp's scatter and by
Cauchy's function. Differences between neighbours and from the thing's mean count as further, weak observations, so that
every vertex has an albedo.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import sparse

from polarsim.photo import NO_ROCK
from polarsim.render.fitting.samples import Samples

# Typical difference of two neighbouring vertices' albedos, and of an albedo from its thing's mean, as shares of them.
_SMOOTHNESS, _SPREAD = 0.05, 0.3
_ROUNDS = 12
_LEAST_SCATTER = 0.03  # of a lamp's residuals
_CAUTION = 2.5  # scatters beyond which residuals lose weight
_ENOUGH = 0.5  # sum of barycentric weights of an observation's samples
_FEW = 2.0  # sum at which an observation counts half
_LEAST_LOOKS = 30  # observations that tell a rock's mean
_STEPS, _CLOSE = 200, 1e-5  # of conjugate gradients


@dataclass(frozen=True)
class Texels:
    """n observations."""

    vertex: np.ndarray  # (n,) int32
    lamp: np.ndarray  # (n,) int16
    ratio: np.ndarray  # (n,) logarithm of the photo's light over the model's
    count: np.ndarray  # (n,) weights of the samples in it

    def part(self, chosen: np.ndarray) -> Texels:
        return Texels(self.vertex[chosen], self.lamp[chosen], self.ratio[chosen], self.count[chosen])


@dataclass(frozen=True)
class Solution:
    """Natural logarithms."""

    albedo: np.ndarray  # (v,) the ground's median is 0
    lamps: dict[int, float]  # grey values per ms and unit radiance, of lamps that were observed
    rocks: dict[int, float]  # means


def texels_of(samples: Samples, radiance: np.ndarray, faces: np.ndarray) -> Texels:
    """Observations from samples (n,) and their radiance (n,) at unit albedo; `faces` (f, 3) number their vertices."""
    found = []
    group = samples.lamp.astype(np.int64) * (int(samples.view.max(initial=0)) + 1) + samples.view
    for number in np.unique(group):
        own = np.flatnonzero(group == number)
        corners = faces.take(samples.face.take(own), axis=0)
        second, third = samples.weights[own].T.astype(float)
        weight = np.stack([1 - second - third, second, third], axis=1)
        vertex, texel = np.unique(corners, return_inverse=True)
        texel = texel.ravel()

        def summed(values: np.ndarray, weight: np.ndarray = weight, texel: np.ndarray = texel) -> np.ndarray:
            return np.bincount(texel, (weight * values[:, None]).ravel())

        light, model, count = summed(samples.rate[own]), summed(radiance[own]), summed(np.ones(len(own)))
        good = (count > _ENOUGH) & (light > 0) & (model > 0)
        lamp = np.full(good.sum(), samples.lamp[own[0]])
        found.append((vertex[good].astype(np.int32), lamp, np.log(light[good] / model[good]), count[good]))
    if not found:
        return Texels(np.zeros(0, np.int32), np.zeros(0, np.int16), np.zeros(0), np.zeros(0))
    return Texels(*(np.concatenate(parts) for parts in zip(*found, strict=True)))


def solve(texels: Texels, faces: np.ndarray, rock_of_vertex: np.ndarray) -> Solution:
    """The albedos and lamps that explain the observations best.

    Parameters
    ----------
    faces : (f, 3) int
        Triangles of all things; no two things share a vertex.
    rock_of_vertex : (v,) int
        `NO_ROCK` is the ground.
    """
    count = len(rock_of_vertex)
    lamps = np.unique(texels.lamp)
    index = np.searchsorted(lamps, texels.lamp)
    gains = np.array([np.median(texels.ratio[index == number]) for number in range(len(lamps))])
    smoothing, neighbours = _smoothing(faces, count, _SMOOTHNESS)
    pull = 1 / _SPREAD**2
    albedo, means = np.zeros(count), np.zeros(count)
    looks = np.bincount(texels.vertex, minlength=count)
    rocks: dict[int, float] = {}
    for _ in range(_ROUNDS if len(texels.ratio) else 0):
        left = texels.ratio - gains[index] - albedo[texels.vertex]
        weight = _weights(left, index, len(lamps), texels.count)
        gains += np.bincount(index, weight * left, len(lamps)) / np.bincount(index, weight, len(lamps))
        towards = np.bincount(texels.vertex, weight * (texels.ratio - gains[index]), count) + pull * means
        diagonal = np.bincount(texels.vertex, weight, count) + pull
        albedo = conjugate_gradients(smoothing, diagonal, diagonal + neighbours, towards, albedo)
        rocks, means = _means(albedo, looks, rock_of_vertex)
        ground = (rock_of_vertex == NO_ROCK) & (looks > 0)
        level = float(np.median(albedo[ground if ground.any() else looks > 0]))
        albedo, means, gains = albedo - level, means - level, gains + level
        rocks = {rock: mean - level for rock, mean in rocks.items()}
    if not rocks:
        rocks, _ = _means(albedo, looks, rock_of_vertex)
    return Solution(albedo, dict(zip(lamps.tolist(), gains.tolist(), strict=True)), rocks)


def conjugate_gradients(
    matrix: sparse.csr_array, diagonal: np.ndarray, whole_diagonal: np.ndarray, towards: np.ndarray, start: np.ndarray
) -> np.ndarray:
    """Solve (matrix + diagonal) x = towards for x, from `start`, with the whole diagonal as Jacobi's preconditioner.

    Sums are NumPy's, not those of BLAS, which depend on the number of threads.
    """
    x = start.copy()
    left = towards - (matrix @ x + diagonal * x)
    ahead = scaled = left / whole_diagonal
    size = float((left * scaled).sum())
    goal = _CLOSE**2 * float((towards * towards / whole_diagonal).sum())
    for _ in range(_STEPS):
        if size <= goal:
            break
        moved = matrix @ ahead + diagonal * ahead
        step = size / float((ahead * moved).sum())
        x = x + step * ahead
        left = left - step * moved
        scaled = left / whole_diagonal
        size, before = float((left * scaled).sum()), size
        ahead = scaled + size / before * ahead
    return x


def _weights(left: np.ndarray, index: np.ndarray, lamps: int, count: np.ndarray) -> np.ndarray:
    scatter = np.array([1.4826 * np.median(np.abs(left[index == number])) for number in range(lamps)])
    scatter = np.maximum(scatter, _LEAST_SCATTER)[index]
    return np.asarray(count / (count + _FEW) / scatter**2 / (1 + (left / (_CAUTION * scatter)) ** 2))


def _smoothing(faces: np.ndarray, count: int, difference: float) -> tuple[sparse.csr_array, np.ndarray]:
    """The graph Laplacian of a mesh over the square of neighbours' typical difference, and its diagonal."""
    edges = np.unique(np.sort(faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1), axis=0)
    one, other = edges.T
    value = 1 / difference**2
    diagonal = value * np.bincount(edges.ravel(), minlength=count).astype(float)
    rows, columns = np.concatenate([one, other, np.arange(count)]), np.concatenate([other, one, np.arange(count)])
    values = np.concatenate([np.full(2 * len(edges), -value), diagonal])
    return sparse.csr_array((values, (rows, columns)), shape=(count, count)), diagonal


def _means(albedo: np.ndarray, looks: np.ndarray, rock_of_vertex: np.ndarray) -> tuple[dict[int, float], np.ndarray]:
    """Mean of every rock, by observations, and (v,) the mean of every vertex's thing; rocks unseen have that of all."""
    _, thing = np.unique(rock_of_vertex, return_inverse=True)
    seen, total = np.bincount(thing, looks), np.bincount(thing, looks * albedo)
    names = np.unique(rock_of_vertex)
    known = seen >= _LEAST_LOOKS
    is_rock = names != NO_ROCK
    usual = float(np.mean(total[known & is_rock] / seen[known & is_rock])) if (known & is_rock).any() else 0.0
    means = np.where(known, total / np.maximum(seen, 1), np.where(is_rock, usual, 0.0))
    rocks = {int(name): float(mean) for name, mean in zip(names, means, strict=True) if name != NO_ROCK}
    return rocks, means[thing]
