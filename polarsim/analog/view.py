"""Surface at each pixel of a camera: point, normal, object and texture."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from polarsim.analog.rays import FirstHits, RayCaster, lengths
from polarsim.analog.sandbox import HALL_OBJECT, SandboxScene, SurfaceMaterial
from polarsim.geometry.camera import Camera
from polarsim.geometry.lens import HALF_PIXEL, Lens

_TILE = 1024  # texels of the repeating textures
_NODE_STEP = 8  # px between nodes of the exact lens solution; the error of bilinear interpolation is below 0.002 px
# Texture by material: cell of the grain, metres; contrast of grain and of patches; strength of the bumps.
_GRAIN_CELL = np.array([0.0012, 0.0025, 0.004, 0.01, 0.002, 0.002, 0.01, 0.01, 0.01], np.float32)
_GRAIN = np.array([0.10, 0.14, 0.03, 0.1, 0.01, 0.01, 0.02, 0.05, 0.1], np.float32)
_PATCH = np.array([0.12, 0.10, 0.05, 0.1, 0.0, 0.0, 0.1, 0.05, 0.2], np.float32)
_BUMP = np.array([0.10, 0.16, 0.015, 0.02, 0.0, 0.0, 0.01, 0.05, 0.05], np.float32)


@dataclass(frozen=True)
class Textures:
    """Periodic tiles of unit variance: sharp grain, smooth patches, and two slopes for bumps."""

    grain: np.ndarray
    patch: np.ndarray
    slope_u: np.ndarray
    slope_v: np.ndarray


@dataclass(frozen=True)
class GBuffer:
    """Surface attributes at the pixels (h, w) of a camera."""

    centre: np.ndarray  # (3,) camera centre, sandbox frame
    points: np.ndarray  # (h, w, 3) float32, sandbox frame, metres
    normals: np.ndarray  # (h, w, 3) float32 unit normals with bumps
    albedo: np.ndarray  # (h, w) float32
    gloss: np.ndarray  # (h, w) float32
    material: np.ndarray  # (h, w) uint8
    objects: np.ndarray  # (h, w) int16: rock numbers, GROUND_OBJECT, HALL_OBJECT
    faces: np.ndarray  # (h, w) int32
    weights: np.ndarray  # (h, w, 2) float32 barycentric weights of the second and third corner
    footprint: np.ndarray  # (h, w) float32 width of a pixel across the line of sight, metres

    @property
    def shape(self) -> tuple[int, int]:
        return self.objects.shape  # type: ignore[return-value]


def make_textures(rng: np.random.Generator) -> Textures:
    from scipy.ndimage import gaussian_filter

    def tile(sigma: float) -> np.ndarray:
        field = gaussian_filter(rng.standard_normal((_TILE, _TILE)).astype(np.float32), sigma, mode="wrap")
        return field / field.std()

    return Textures(tile(0.6), tile(6), tile(1.2), tile(1.2))


@lru_cache(maxsize=2)
def lens_directions(lens: Lens) -> np.ndarray:
    """Return directions (h, w, 3) float32 with z = 1 through pixel centres, bilinear between exact nodes."""
    nodes = [np.append(np.arange(0, size, _NODE_STEP), size).astype(float) for size in (lens.width, lens.height)]
    net = lens.directions(np.stack(np.meshgrid(*nodes), axis=-1))[..., :2]

    def fill(net: np.ndarray, size: int) -> np.ndarray:
        """Interpolate linearly along the first axis at pixel centres."""
        at = np.arange(size) + HALF_PIXEL
        low = (at // _NODE_STEP).astype(int)
        span = np.minimum((low + 1) * _NODE_STEP, size) - low * _NODE_STEP
        share = ((at - low * _NODE_STEP) / span)[:, None, None]
        return net[low] * (1 - share) + net[low + 1] * share

    plane = fill(fill(net, lens.height).swapaxes(0, 1), lens.width).swapaxes(0, 1)
    return np.concatenate([plane, np.ones((*plane.shape[:2], 1))], axis=-1).astype(np.float32)


def strips(height: int, rows: int = 152) -> Iterator[slice]:
    """Yield strips of image rows, to limit memory."""
    for start in range(0, height, rows):
        yield slice(start, min(start + rows, height))


def pixels(values: np.ndarray, chosen: np.ndarray) -> np.ndarray:
    """Return the values (n, ...) of (h, w, ...) at the pixels with numbers (n,), ten times as fast as by a mask."""
    return values.reshape(-1, *values.shape[2:]).take(chosen, axis=0)


def render_gbuffer(scene: SandboxScene, caster: RayCaster, textures: Textures, camera: Camera) -> GBuffer:
    """Cast a ray through every pixel of a camera and return the surface attributes."""
    directions = lens_directions(camera.lens)
    height, width = camera.lens.shape
    empty = {
        "points": ((3,), np.float32), "normals": ((3,), np.float32), "albedo": ((), np.float32),
        "gloss": ((), np.float32), "material": ((), np.uint8), "objects": ((), np.int16), "faces": ((), np.int32),
        "weights": ((2,), np.float32), "footprint": ((), np.float32),
    }  # fmt: skip
    parts = {name: np.zeros((height, width, *shape), dtype) for name, (shape, dtype) in empty.items()}
    rotation = camera.world_from_camera.rotation.astype(np.float32)
    centre = camera.centre.astype(np.float32)
    for rows in strips(height):
        rotated = directions[rows] @ rotation.T
        hit = caster.first_hits(centre, rotated)
        for name, values in _surface(scene, textures, hit, rotated, centre, camera.lens.fx).items():
            parts[name][rows] = values
    return GBuffer(camera.centre, **parts)


def _surface(
    scene: SandboxScene,
    textures: Textures,
    hit: FirstHits,
    rotated: np.ndarray,
    centre: np.ndarray,
    focal: float,
) -> dict[str, np.ndarray]:
    missed = ~hit.is_hit
    distance = np.where(missed, np.float32(20.0), hit.distance)
    face, weights = hit.face, hit.weights
    points = centre + distance[..., None] * rotated
    corners = scene.faces[face]
    second, third = weights[..., :1], weights[..., 1:]
    normals = (
        scene.normals[corners[..., 0]] * (1 - second - third)
        + scene.normals[corners[..., 1]] * second
        + scene.normals[corners[..., 2]] * third
    )
    material = scene.material[face]
    footprint = distance * lengths(rotated) / np.float32(focal)
    albedo, bumpy = _textured(scene, textures, face, points, normals, material, footprint)
    objects = np.where(missed, HALL_OBJECT, scene.object_of_face[face])
    return {
        "points": points, "normals": bumpy, "albedo": np.where(missed, 0, albedo), "gloss": scene.gloss_of_face[face],
        "material": np.where(missed, SurfaceMaterial.DARK, material), "objects": objects, "faces": face,
        "weights": weights, "footprint": footprint,
    }  # fmt: skip


def _textured(
    scene: SandboxScene, textures: Textures, face: np.ndarray, points: np.ndarray, normals: np.ndarray,
    material: np.ndarray, footprint: np.ndarray,
) -> tuple[np.ndarray, np.ndarray]:  # fmt: skip
    """Return albedo with grain and patches, and unit normals with bumps; both fade if a pixel spans many grains."""
    steep = np.argmax(np.abs(normals), axis=-1)  # the texture is projected along the dominant axis of the normal
    u = np.where(steep == 0, points[..., 1], points[..., 0])
    v = np.where(steep == 2, points[..., 1], points[..., 2])

    def texel(tile: np.ndarray, cell: np.ndarray | float) -> np.ndarray:
        row = np.floor(u / cell).astype(np.int32) & (_TILE - 1)
        column = np.floor(v / cell).astype(np.int32) & (_TILE - 1)
        return tile[row, column]

    cell = _GRAIN_CELL[material]
    fade = 1 / np.sqrt(1 + (0.6 * footprint / cell) ** 2)
    grain, patch = texel(textures.grain, cell), texel(textures.patch, 0.02)
    fresh = scene.patch_of_face[face] * (texel(textures.patch, 0.006) > 0.6)
    albedo = scene.albedo_of_face[face] * (1 + fresh)
    albedo = albedo * np.clip(1 + _GRAIN[material] * fade * grain + _PATCH[material] * patch, 0.2, 2)
    strength = (_BUMP[material] * fade)[..., None]
    slopes = np.stack(
        [texel(textures.slope_u, cell * 2), texel(textures.slope_v, cell * 2), texel(textures.grain, cell * 3)], axis=-1
    )
    bumpy = normals + strength * slopes
    bumpy /= np.maximum(lengths(bumpy), 1e-6)[..., None]
    return np.minimum(albedo, 0.9).astype(np.float32), bumpy.astype(np.float32)
