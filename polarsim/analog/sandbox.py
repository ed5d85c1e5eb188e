"""Scene as triangles: sand, rocks, walls with pale cloth, grey cards, and the surrounding dark hall."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from enum import IntEnum

import numpy as np

from polarsim.analog.ground import HeightField
from polarsim.analog.presets import Preset
from polarsim.analog.rays import RayCaster, grid_faces
from polarsim.analog.rocks import SimulatedRock, icosphere
from polarsim.survey import WALL_HEIGHT

GROUND_OBJECT, HALL_OBJECT = -1, -2  # object numbers; rocks have positive numbers
_WALL_TOP = WALL_HEIGHT + 0.01  # metres: differs from the stated height, as the real walls do
_WALL_THICKNESS = 0.09  # metres
HALL_FLOOR = -0.40  # metres: below the deepest crater, so that the floor is not visible in it


class SurfaceMaterial(IntEnum):
    SAND = 0
    ROCK = 1
    CLOTH = 2
    DARK = 3
    GREY = 4
    WHITE = 5
    FLOOR = 6
    CURTAIN = 7
    METAL = 8


@dataclass(frozen=True)
class SandboxScene:
    """Triangles with object numbers and materials: ground first, then rocks in order, then the hall."""

    vertices: np.ndarray  # (v, 3) float32, metres, sandbox frame
    normals: np.ndarray  # (v, 3) float32, unit
    faces: np.ndarray  # (f, 3) uint32
    material: np.ndarray  # (f,) uint8
    object_of_face: np.ndarray  # (f,) int16
    albedo_of_face: np.ndarray  # (f,) float32, before texture
    gloss_of_face: np.ndarray  # (f,) float32
    patch_of_face: np.ndarray  # (f,) float32
    first_vertex: dict[int, int]  # number of the first vertex by object
    ground: HeightField
    rocks: list[SimulatedRock]

    def caster(self) -> RayCaster:
        """Return a ray caster of all triangles."""
        return RayCaster(self.vertices, self.faces)

    def rock_caster(self) -> RayCaster:
        """Return a ray caster of the rocks only; the scene must have a rock."""
        faces = self.faces[self.object_of_face > 0]
        low, high = int(faces.min()), int(faces.max())
        return RayCaster(self.vertices[low : high + 1], faces - low)


@dataclass(frozen=True)
class _Part:
    vertices: np.ndarray
    faces: np.ndarray
    material: SurfaceMaterial
    albedo: float
    object_id: int = HALL_OBJECT
    normals: np.ndarray | None = None
    gloss: float = 0.0
    patch: float = 0.0


def build_scene(
    preset: Preset, ground: HeightField, rocks: Sequence[SimulatedRock], detail: int, rng: np.random.Generator
) -> SandboxScene:
    """Combine ground, rocks, walls and hall."""
    small = preset.half_width < 1
    vertices, faces = ground.mesh()
    sand = 0.36 if small else 0.19
    parts = [_Part(vertices, faces, SurfaceMaterial.SAND, sand, GROUND_OBJECT, ground.normals())]
    sphere_faces = icosphere(detail)[1]
    for rock in rocks:
        parts.append(
            _Part(
                rock.vertices, sphere_faces, SurfaceMaterial.ROCK, rock.albedo, rock.rock, None, rock.gloss, rock.patch
            )
        )
    parts += _small_box(preset, rng) if small else _big_box(preset, rng)
    starts = np.cumsum([0, *(len(part.vertices) for part in parts)])
    counts = [len(part.faces) for part in parts]

    def per_face(values: list[float], dtype: type) -> np.ndarray:
        return np.repeat(np.array(values, dtype), counts)

    first: dict[int, int] = {}
    for part, start in zip(parts, starts, strict=False):
        first.setdefault(part.object_id, int(start))
    return SandboxScene(
        np.concatenate([part.vertices for part in parts]).astype(np.float32),
        np.concatenate([_normals(p) if p.normals is None else p.normals for p in parts]).astype(np.float32),
        np.concatenate([part.faces + start for part, start in zip(parts, starts, strict=False)]).astype(np.uint32),
        per_face([part.material for part in parts], np.uint8),
        per_face([part.object_id for part in parts], np.int16),
        per_face([part.albedo for part in parts], np.float32),
        per_face([part.gloss for part in parts], np.float32),
        per_face([part.patch for part in parts], np.float32),
        first,
        ground,
        list(rocks),
    )


def _normals(part: _Part) -> np.ndarray:
    a, b, c = (part.vertices[part.faces[:, k]] for k in range(3))
    of_face = np.cross(b - a, c - a)
    normals = np.stack(
        [
            sum(np.bincount(part.faces[:, k], of_face[:, axis], len(part.vertices)) for k in range(3))
            for axis in range(3)
        ],
        axis=1,
    )
    return normals / np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-12)


def _sheet(
    corner: Sequence[float], u: Sequence[float], v: Sequence[float], step: float
) -> tuple[np.ndarray, np.ndarray]:
    """Return a rectangle as a grid of triangles with normal u x v."""
    start, u, v = np.array(corner, float), np.array(u, float), np.array(v, float)  # type: ignore[assignment]
    nu, nv = (max(1, int(np.ceil(np.linalg.norm(edge) / step))) + 1 for edge in (u, v))
    s, t = np.meshgrid(np.linspace(0, 1, nu), np.linspace(0, 1, nv), indexing="ij")
    vertices = start + s.reshape(-1, 1) * u + t.reshape(-1, 1) * v
    return vertices, grid_faces(nu, nv)


def _block(
    low: Sequence[float], high: Sequence[float], material: SurfaceMaterial, albedo: float, step: float
) -> list[_Part]:
    """Return the six sides of an axis-aligned block."""
    x0, y0, z0 = low
    dx, dy, dz = (float(h - lo) for h, lo in zip(high, low, strict=True))
    sheets = [
        _sheet([x0, y0, z0 + dz], [dx, 0, 0], [0, dy, 0], step),
        _sheet([x0, y0, z0], [0, dy, 0], [dx, 0, 0], step),
        _sheet([x0 + dx, y0, z0], [0, dy, 0], [0, 0, dz], step),
        _sheet([x0, y0, z0], [0, 0, dz], [0, dy, 0], step),
        _sheet([x0, y0 + dy, z0], [0, 0, dz], [dx, 0, 0], step),
        _sheet([x0, y0, z0], [dx, 0, 0], [0, 0, dz], step),
    ]
    return [_Part(vertices, faces, material, albedo) for vertices, faces in sheets]


def _walls(
    half: float, top: float, thick: float, material: SurfaceMaterial, albedo: float, rng: np.random.Generator
) -> list[_Part]:
    outer = half + thick
    spans = [
        ([-outer, -outer], [-half, outer]), ([half, -outer], [outer, outer]),
        ([-half, -outer], [half, -half]), ([-half, half], [half, outer]),
    ]  # fmt: skip
    parts = []
    for low, high in spans:
        height = top + rng.normal(0, 0.008)
        for part in _block([*low, HALL_FLOOR], [*high, height], material, albedo, 0.06):
            wavy = part.vertices.copy()  # folds of the cloth
            s = wavy[:, 0] + wavy[:, 1]
            up = np.clip((wavy[:, 2] - HALL_FLOOR) / (height - HALL_FLOOR), 0, 1)
            wavy[:, 2] += up * (0.006 * np.sin(5 * s + rng.uniform(0, 6)) + 0.004 * np.sin(17 * s))
            bent = _normals(_Part(wavy, part.faces, material, albedo))
            bent += 0.10 * np.stack(
                [np.sin(9 * s + 2 * wavy[:, 2]), np.cos(13 * s), np.sin(23 * wavy[:, 2] + 4 * s)], 1
            )
            bent /= np.linalg.norm(bent, axis=1, keepdims=True)
            parts.append(_Part(wavy, part.faces, material, albedo, normals=bent))
    return parts


def _big_box(preset: Preset, rng: np.random.Generator) -> list[_Part]:
    """Return the walls of NASA's sandbox and the hall."""
    half = preset.half_width
    parts = _walls(half, _WALL_TOP, _WALL_THICKNESS, SurfaceMaterial.CLOTH, 0.52, rng)
    for y in (-1.62 + rng.normal(0, 0.03), 1.62 + rng.normal(0, 0.03)):
        z, x = 0.08 + rng.uniform(0, 0.03), -half + 0.012
        for width, height, out, material, albedo in (
            (0.30, 0.22, 0.0, SurfaceMaterial.WHITE, 0.80), (0.26, 0.18, 0.004, SurfaceMaterial.GREY, 0.18),
        ):  # fmt: skip
            sheet = _sheet([x + out, y - width / 2, z + 0.11 - height / 2], [0, width, 0], [0.01, 0, height], 0.1)
            parts.append(_Part(*sheet, material, albedo))
    parts += _block([-half - 0.1, -half - 0.1, 0], [-half + 0.16, -half + 0.14, 0.33], SurfaceMaterial.DARK, 0.02, 0.1)
    parts += _hall()
    for y0, y1 in ((-2.5, -0.72), (-0.66, 0.33), (0.39, 2.1)):  # curtains with folds
        vertices, faces = _sheet([-4.0, y0, HALL_FLOOR], [0, y1 - y0, 0], [0, 0, 3.0], 0.05)
        vertices[:, 0] += 0.02 * np.sin(vertices[:, 1] * rng.uniform(18, 26)) + 0.01 * np.sin(vertices[:, 1] * 61)
        parts.append(_Part(vertices, faces, SurfaceMaterial.CURTAIN, rng.uniform(0.16, 0.3)))
    for x, y, width in ((-3.2, 0.06, 0.04), (-3.5, 0.9, 0.02), (-3.4, 1.0, 0.02), (0.4, 3.4, 0.03), (-2.6, 3.0, 0.03)):
        parts += _block([x, y, HALL_FLOOR], [x + width, y + width, 2.4], SurfaceMaterial.METAL, 0.12, 0.5)
    parts.append(_duct(np.array([-2.35, 2.35, 0.0]), 0.13, 0.75))
    return parts


def _small_box(preset: Preset, rng: np.random.Generator) -> list[_Part]:
    """Return the black box of terrain 13 on a tiled floor, next to a bright ball."""
    half = preset.half_width
    vertices, faces = icosphere(4)
    ball = _Part(vertices * 0.10 + [0.1, 0.85, HALL_FLOOR + 0.10], faces, SurfaceMaterial.METAL, 0.6, gloss=2.0)
    return [*_walls(half, 0.05, 0.03, SurfaceMaterial.DARK, 0.04, rng), *_hall(floor_albedo=0.35), ball]


def _hall(floor_albedo: float = 0.05) -> list[_Part]:
    """Return the inner sides of a dark room."""
    low, high = np.array([-5.5, -6.5, HALL_FLOOR]), np.array([9.5, 6.0, 3.8])
    dx, dy, dz = high - low
    x0, y0, z0 = low
    sides = [
        _sheet([x0, y0, z0], [0, dy, 0], [0, 0, dz], 0.8), _sheet([high[0], y0, z0], [0, 0, dz], [0, dy, 0], 0.8),
        _sheet([x0, y0, z0], [0, 0, dz], [dx, 0, 0], 0.8), _sheet([x0, high[1], z0], [dx, 0, 0], [0, 0, dz], 0.8),
        _sheet([x0, y0, high[2]], [0, dy, 0], [dx, 0, 0], 0.8),
    ]  # fmt: skip
    floor = _Part(*_sheet(low.tolist(), [dx, 0, 0], [0, dy, 0], 0.25), SurfaceMaterial.FLOOR, floor_albedo)
    return [floor, *(_Part(*sheet, SurfaceMaterial.DARK, 0.03) for sheet in sides)]


def _duct(foot: np.ndarray, radius: float, height: float) -> _Part:
    """Return a ribbed, shiny tube."""
    vertices, faces = _sheet([0, 0, 0], [2 * np.pi, 0, 0], [0, 0, height], 0.04)
    angle, z = vertices[:, 0], vertices[:, 2]
    width = radius + 0.008 * np.sin(z * 150)
    tube = np.stack([width * np.cos(angle) + 0.25 * z, width * np.sin(angle) + 0.2 * z, z], axis=1) + foot
    return _Part(tube, faces, SurfaceMaterial.METAL, 0.35, gloss=1.0)
