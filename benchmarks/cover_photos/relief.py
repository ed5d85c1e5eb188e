"""Made-up relief of sand: ridges of a rake, swells and craters, for twins of sand whose surface nobody published."""

from __future__ import annotations

import numpy as np
from pydantic import BaseModel, Field

from polarsim.geometry.meshes import Mesh

Range = tuple[float, float]


class ReliefOptions(BaseModel, extra="forbid", frozen=True):
    """Ranges, from least to most, that every variant draws its sand from. Metres."""

    cell_m: float = Field(0.015, gt=0, description="Side of the ground mesh's cells.")
    layers: int = Field(3, ge=0, description="Layers of ridges, each along a direction of its own.")
    ridge_sd_m: Range = Field((0.0003, 0.0025), description="Standard deviation of a layer's heights.")
    ridge_width_m: Range = Field((0.01, 0.03), description="Correlation length across a ridge.")
    ridge_length_m: Range = Field((0.015, 0.12), description="Correlation length along a ridge.")
    swell_sd_m: Range = Field((0.0, 0.02), description="Standard deviation of wide swells.")
    swell_width_m: float = Field(0.25, gt=0, description="Correlation length of swells.")
    most_craters: int = Field(2, ge=0, description="A variant has from none to so many craters.")
    crater_radius_m: Range = Field((0.1, 0.9), description="Radius of a crater at its crest.")
    crater_depth: Range = Field((0.1, 0.3), description="Depth of a crater over its radius.")


def smooth_noise(
    shape: tuple[int, int], along: float, across: float, angle: float, random: np.random.Generator
) -> np.ndarray:
    """(h, w) normal noise of mean 0 and sd 1, correlated over `along` and `across` cells; `angle`: of the long axis."""
    v, u = np.meshgrid(np.fft.fftfreq(shape[0]), np.fft.fftfreq(shape[1]), indexing="ij")
    cosine, sine = np.cos(angle), np.sin(angle)
    exponent = (along * (cosine * u + sine * v)) ** 2 + (across * (cosine * v - sine * u)) ** 2
    filtered = np.fft.ifft2(np.fft.fft2(random.standard_normal(shape)) * np.exp(-2 * np.pi**2 * exponent)).real
    filtered -= filtered.mean()
    return np.asarray(filtered / filtered.std())


def crater(x: np.ndarray, y: np.ndarray, radius: float, depth: float) -> np.ndarray:
    """Heights of a bowl about the origin, with a crest a fifth as high as the bowl is deep; flat beyond two radii."""
    distance = np.hypot(x, y) / radius
    crest = 0.2 * depth
    bowl = (depth + crest) * distance**2 - depth
    return np.where(distance < 1, bowl, crest * np.clip(2 - distance, 0, 1) ** 2)


def draw_relief(x: np.ndarray, y: np.ndarray, options: ReliefOptions, random: np.random.Generator) -> np.ndarray:
    """(h, w) heights above the smooth sand at places (h, w) of a grid of `cell_m`, rows along y."""
    height = np.zeros(x.shape)
    for _ in range(options.layers):
        along, across, sd = (random.uniform(*limits) for limits in (
            options.ridge_length_m, options.ridge_width_m, options.ridge_sd_m
        ))  # fmt: skip
        turned = random.uniform(0, np.pi)
        height += sd * smooth_noise(x.shape, along / options.cell_m, across / options.cell_m, turned, random)
    width = options.swell_width_m / options.cell_m
    height += random.uniform(*options.swell_sd_m) * smooth_noise(x.shape, width, width, 0, random)
    for _ in range(random.integers(options.most_craters + 1)):
        radius, share = random.uniform(*options.crater_radius_m), random.uniform(*options.crater_depth)
        centre = random.uniform(0.8 * np.array([x.min(), y.min()]), 0.8 * np.array([x.max(), y.max()]))
        height += crater(x - centre[0], y - centre[1], radius, share * radius)
    return height


def smooth_sand(ground: np.ndarray) -> np.ndarray:
    """(6,) least-squares quadric of a ground's vertices (n, 3): z of 1, x, y, x^2, x y, y^2."""
    return np.asarray(np.linalg.lstsq(_powers(ground[:, 0], ground[:, 1]), ground[:, 2], rcond=None)[0])


def sand_height(quadric: np.ndarray, x: np.ndarray, y: np.ndarray) -> np.ndarray:
    return np.asarray(_powers(x, y) @ quadric)


def grid_mesh(x: np.ndarray, y: np.ndarray, z: np.ndarray) -> Mesh:
    """Two triangles a cell of heights (h, w) at places (h, w), facing up where x grows along rows, y along columns."""
    numbers = np.arange(x.size).reshape(x.shape)
    a, b, c, d = (part.ravel() for part in (numbers[:-1, :-1], numbers[:-1, 1:], numbers[1:, 1:], numbers[1:, :-1]))
    faces = np.concatenate([np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)])
    return Mesh(np.stack([x.ravel(), y.ravel(), z.ravel()], axis=1), faces)


def _powers(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    return np.stack([np.ones_like(x), x, y, x**2, x * y, y**2], axis=-1)
