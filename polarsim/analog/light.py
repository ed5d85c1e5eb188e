"""Direct light of a disc lamp with falloff and soft shadows, and reflectance of surfaces."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from polarsim.analog.rays import RayCaster, lengths
from polarsim.analog.sandbox import SurfaceMaterial
from polarsim.analog.view import GBuffer, pixels, strips

SURFACE_OFFSET = np.float32(0.0015)  # rays start this far above a surface, metres
BEFORE_LAMP = 0.995  # shadow rays end at this share of the distance from the lamp
_BEAM_HALF_WIDTH = np.radians(42.0)
# By material (sand, rock, cloth, dark, grey, white, floor, curtain, metal).
_ROUGHNESS = np.radians([18, 22, 12, 25, 10, 5, 20, 25, 15]).astype(np.float32)  # standard deviation of facet slopes
_SURGE = np.array([0.55, 0.35, 0.10, 0.1, 0.02, 0.02, 0.1, 0.1, 0.0], np.float32)  # height of the opposition surge
_SURGE_WIDTH = np.array([0.09, 0.06, 0.05, 0.1, 0.1, 0.1, 0.1, 0.1, 0.1], np.float32)  # tan of half the half-width
_FORWARD = np.array(
    [5.0, 0.4, 0.2, 0.2, 0, 0, 0.5, 0.2, 0], np.float32
)  # strength of forward scattering by glassy grains
_FORWARD_POWER = 8
_GLOSS_POWER = 30


def reflect(
    material: np.ndarray, albedo: np.ndarray, gloss: np.ndarray, normals: np.ndarray, to_light: np.ndarray,
    to_eye: np.ndarray,
) -> np.ndarray:  # fmt: skip
    """Return the BRDF times the cosine of incidence, 1/sr; 0 if the light is behind the surface.

    The BRDF combines rough diffuse reflection (Oren and Nayar, SIGGRAPH 1994, in Fujii's form without angles), an
    opposition surge, a forward lobe and, on some rocks, gloss. It differs on purpose from the models of the twins
    (Hapke, Burley).

    `albedo`: hemispherical albedo of the diffuse part. Vectors (..., 3) are unit vectors, float32.
    """
    cos_i = np.einsum("...k,...k->...", normals, to_light)
    cos_e = np.maximum(np.einsum("...k,...k->...", normals, to_eye), 0.02)
    cos_phase = np.clip(np.einsum("...k,...k->...", to_light, to_eye), -1, 1)
    variance = _ROUGHNESS[material] ** 2
    s = cos_phase - cos_i * cos_e
    t = np.where(s > 0, np.maximum(cos_i, cos_e), 1)
    matte = 1 - 0.5 * variance / (variance + 0.33) + 0.45 * variance / (variance + 0.09) * s / np.maximum(t, 0.02)
    half_phase = np.sqrt((1 - cos_phase) / (1 + cos_phase + 1e-6))
    surge = 1 + _SURGE[material] / (1 + half_phase / _SURGE_WIDTH[material])
    onwards = 1 + _FORWARD[material] * (0.5 - 0.5 * cos_phase) ** _FORWARD_POWER
    brdf = albedo / np.float32(np.pi) * matte * surge * onwards
    if gloss.any():
        half = to_light + to_eye
        half /= np.maximum(lengths(half), 1e-6)[..., None]
        shine = np.maximum(np.einsum("...k,...k->...", normals, half), 0) ** _GLOSS_POWER
        brdf = brdf + np.float32(0.1) * gloss * shine
    return np.where(cos_i > 0, brdf * cos_i, 0).astype(np.float32)


@dataclass(frozen=True)
class DiscLamp:
    """Disc lamp directed at a target."""

    position: np.ndarray
    target: np.ndarray
    radius: float
    intensity: float = 1.0  # radiant intensity on the axis, relative to lamp "30"

    @property
    def axis(self) -> np.ndarray:
        return (self.target - self.position) / np.linalg.norm(self.target - self.position)

    def disc(self, unit_samples: np.ndarray) -> np.ndarray:
        """Map samples (..., 2) of the unit disc to points (..., 3) on the lamp."""
        side = np.cross(self.axis, [0, 0, 1.0])
        side /= np.linalg.norm(side)
        up = np.cross(side, self.axis)
        points = np.empty((*unit_samples.shape[:-1], 3), np.float32)
        for axis, (at, aside, above) in enumerate(zip(self.position, side, up, strict=True)):
            points[..., axis] = at + self.radius * (unit_samples[..., 0] * aside + unit_samples[..., 1] * above)
        return points

    def irradiance(self, to_lamp: np.ndarray, distance: np.ndarray) -> np.ndarray:
        """Return the irradiance (...) normal to the beam for unit vectors (..., 3) and distances (...) to the lamp."""
        cosine = -(to_lamp @ self.axis.astype(np.float32))
        angle = np.arccos(np.clip(cosine, -1, 1))
        beam = self.intensity * (0.02 + 0.98 * np.exp(-((angle / _BEAM_HALF_WIDTH) ** 4)))
        return (beam / distance**2).astype(np.float32)


def towards(lamp: DiscLamp, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return unit vectors (..., 3) and distances (...) from points to the centre of a lamp."""
    to_lamp = lamp.position.astype(np.float32) - points
    distance = lengths(to_lamp)
    return to_lamp / distance[..., None], distance


def direct(view: GBuffer, lamp: DiscLamp, visible: np.ndarray) -> np.ndarray:
    """Return the radiance (h, w) of directly lit surfaces; `visible` (h, w) is the visible share of the lamp."""
    out = np.zeros(view.shape, np.float32)
    for rows in strips(len(out)):
        share = visible[rows].ravel()
        lit = np.flatnonzero(share > 0)
        points, material, albedo, gloss, normals = (
            pixels(part[rows], lit) for part in (view.points, view.material, view.albedo, view.gloss, view.normals)
        )
        to_lamp, distance = towards(lamp, points)
        to_eye = view.centre.astype(np.float32) - points
        to_eye /= lengths(to_eye)[..., None]
        shade = reflect(material, albedo, gloss, normals, to_lamp, to_eye) * lamp.irradiance(to_lamp, distance)
        out[rows].reshape(-1)[lit] = shade * share[lit]
    return out


def visibility(view: GBuffer, caster: RayCaster, lamp: DiscLamp, rng: np.random.Generator) -> np.ndarray:
    """Return the visible share (h, w) of the disc of a lamp.

    One ray per pixel is cast to a random point on the disc, and neighbouring pixels are averaged over the width of the
    penumbra, which follows from the distances of pixel, occluder and lamp.
    """
    import cv2

    visible = np.ones(view.shape, np.float32)
    penumbra = np.zeros(view.shape, np.float32)  # px
    for rows in strips(len(visible)):
        points = view.points[rows] + SURFACE_OFFSET * view.normals[rows]
        to_disc = lamp.disc(_unit_disc(rng, view.objects[rows].shape)) - points
        facing = np.einsum("...k,...k->...", view.normals[rows], to_disc) > 0
        facing &= view.material[rows] != SurfaceMaterial.DARK  # no rays for black cloth
        cast = np.flatnonzero(facing)
        occluded = cast[caster.occluded(pixels(points, cast), pixels(to_disc, cast), BEFORE_LAMP)]
        visible[rows] = facing
        visible[rows].reshape(-1)[occluded] = 0
        hit = caster.first_hits(pixels(points, occluded), pixels(to_disc, occluded))
        share = np.clip(hit.distance, 0.0, 0.9)
        width = 2 * lamp.radius * share / (1 - share) / pixels(view.footprint[rows], occluded)
        penumbra[rows].reshape(-1)[occluded] = width
    wide = cv2.dilate(cv2.blur(penumbra, (5, 5)), np.ones((15, 15), np.uint8))
    smooth = cv2.blur(visible, (3, 3))
    for size, min_width in ((5, 5), (11, 12), (21, 30)):
        smooth = np.where(wide > min_width, cv2.blur(visible, (size, size)), smooth)
    return smooth


def _unit_disc(rng: np.random.Generator, shape: tuple[int, ...]) -> np.ndarray:
    """Return random points (*shape, 2) in the unit disc, stratified over blocks of 2 x 2 pixels."""
    row, column = np.indices(shape, sparse=True)
    quarter = ((row & 1) * 2 + (column & 1)).astype(np.float32)
    angle = (quarter + rng.random(shape, dtype=np.float32)) * np.float32(np.pi / 2)
    radius = np.sqrt(rng.random(shape, dtype=np.float32))
    return np.stack([radius * np.cos(angle), radius * np.sin(angle)], axis=-1)
