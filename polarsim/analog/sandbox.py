"""Scene as triangles: sand, rocks, walls with pale cloth, grey cards, and the surrounding dark hall."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from enum import IntEnum

import numpy as np

from polarsim.analog.ground import PRESET_HALF_WIDTH, HeightField
from polarsim.analog.rays import RayCaster, grid_faces
from polarsim.analog.rocks import SimulatedRock, icosphere
from polarsim.site import Site
from polarsim.site_parts import Sandbox, Side

GROUND_OBJECT, HALL_OBJECT = -1, -2  # object numbers; rocks have positive numbers
_WALL_ERROR = 0.01  # metres: the walls are higher than stated, as the real walls are
_WALL_THICKNESS = 0.09  # metres
_RAISED_RIM, _RAISED_THICKNESS = 0.05, 0.03  # metres: rim of a raised box
_CARD_TOP = 0.30  # metres: minimum height of a wall with grey cards
_OPEN_EDGE = -0.01  # metres: top of the board at a side without wall, just below the sand
_SIDES: tuple[Side, ...] = ("-x", "+x", "-y", "+y")
_CLEARANCE = 0.3  # metres around lamps and tripods without posts
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

    def caster(self, threads: int = 1) -> RayCaster:
        """Return a ray caster of all triangles."""
        return RayCaster(self.vertices, self.faces, threads)

    def rock_caster(self, threads: int = 1) -> RayCaster:
        """Return a ray caster of the rocks only; the scene must have a rock."""
        faces = self.faces[self.object_of_face > 0]
        low, high = int(faces.min()), int(faces.max())
        return RayCaster(self.vertices[low : high + 1], faces - low, threads)


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


@dataclass(frozen=True)
class Hall:
    """Dark hall around the sandbox of a site. Its furniture keeps the distance from the sand that it has at NASA."""

    half_width: np.ndarray  # (2,) of the sand, metres
    stands: np.ndarray  # (n, 3) approximate positions of lamps and tripods, metres
    is_open: bool  # outdoors, without walls and ceiling

    @classmethod
    def of(cls, site: Site) -> Hall:
        """Return the hall of a site; a yard with a directional lamp, such as the Sun, is outdoors."""
        lamps = [lamp.point for lamp in site.lamps.values() if lamp.kind == "point"]
        stands = [*lamps, *(tripod.camera_m for tripod in site.tripods.values())]
        is_open = any(lamp.kind == "directional" for lamp in site.lamps.values())
        return cls(np.array(site.sandbox.half_width_m), np.array(stands, float).reshape(-1, 3), is_open)

    def placed(self, x: float, y: float) -> np.ndarray:
        """Return the place (2,) of a piece that is at x, y in NASA's hall: outside the sand at the same distance."""
        place, beyond = np.array([x, y]), self.half_width - PRESET_HALF_WIDTH
        outside = np.abs(place) > PRESET_HALF_WIDTH
        return np.where(outside, place + np.sign(place) * beyond, place * (self.half_width / PRESET_HALF_WIDTH))

    def is_free(self, place: np.ndarray) -> bool:
        """Return whether a place (2,) is not next to a lamp or tripod."""
        return bool((np.linalg.norm(self.stands[:, :2] - place, axis=1) > _CLEARANCE).all())


def build_scene(
    sandbox: Sandbox,
    hall: Hall,
    ground: HeightField,
    rocks: Sequence[SimulatedRock],
    detail: int,
    rng: np.random.Generator,
) -> SandboxScene:
    """Combine ground, rocks, walls and hall."""
    vertices, faces = ground.mesh()
    sand = 0.36 if sandbox.raised else 0.19
    parts = [_Part(vertices, faces, SurfaceMaterial.SAND, sand, GROUND_OBJECT, ground.normals())]
    sphere_faces = icosphere(detail)[1]
    for rock in rocks:
        parts.append(
            _Part(
                rock.vertices, sphere_faces, SurfaceMaterial.ROCK, rock.albedo, rock.rock, None, rock.gloss, rock.patch
            )
        )
    parts += _raised_box(sandbox, hall, rng) if sandbox.raised else _walled_sand(sandbox, hall, rng)
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
    half: Sequence[float], tops: Sequence[float | None], thick: float, material: SurfaceMaterial, albedo: float,
    rng: np.random.Generator,
) -> list[_Part]:  # fmt: skip
    """Return the walls of the sides in the order of `_SIDES`; a side without height has a board below the sand."""
    x, y = half
    outer_x, outer_y = x + thick, y + thick
    spans = [
        ([-outer_x, -outer_y], [-x, outer_y]), ([x, -outer_y], [outer_x, outer_y]),
        ([-x, -outer_y], [x, -y]), ([-x, y], [x, outer_y]),
    ]  # fmt: skip
    parts = []
    for (low, high), top in zip(spans, tops, strict=True):
        if top is None:
            parts += _block([*low, HALL_FLOOR], [*high, _OPEN_EDGE], SurfaceMaterial.DARK, 0.1, 0.3)
            continue
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


def _walled_sand(sandbox: Sandbox, hall: Hall, rng: np.random.Generator) -> list[_Part]:
    """Return the walls around the sand, grey cards on the wall -x, and the hall with its furniture."""
    half_x, half_y = sandbox.half_width_m
    stated = [sandbox.walls_m.get(side) for side in _SIDES]
    tops = [None if height is None else height + _WALL_ERROR for height in stated]
    parts = _walls((half_x, half_y), tops, _WALL_THICKNESS, SurfaceMaterial.CLOTH, 0.52, rng)
    scale_y = half_y / PRESET_HALF_WIDTH
    for y in (-1.62 * scale_y + rng.normal(0, 0.03), 1.62 * scale_y + rng.normal(0, 0.03)):
        z, x = 0.08 + rng.uniform(0, 0.03), -half_x + 0.012
        if tops[0] is None or tops[0] < _CARD_TOP:
            continue
        for width, height, out, material, albedo in (
            (0.30, 0.22, 0.0, SurfaceMaterial.WHITE, 0.80), (0.26, 0.18, 0.004, SurfaceMaterial.GREY, 0.18),
        ):  # fmt: skip
            sheet = _sheet([x + out, y - width / 2, z + 0.11 - height / 2], [0, width, 0], [0.01, 0, height], 0.1)
            parts.append(_Part(*sheet, material, albedo))
    if tops[0] is not None and tops[2] is not None:
        low, high = [-half_x - 0.1, -half_y - 0.1, 0], [-half_x + 0.16, -half_y + 0.14, tops[0] + 0.02]
        parts += _block(low, high, SurfaceMaterial.DARK, 0.02, 0.1)
    parts += _hall(hall)
    return parts if hall.is_open else parts + _furniture(hall, rng)


def _furniture(hall: Hall, rng: np.random.Generator) -> list[_Part]:
    """Return curtains behind the sand and all lamps, posts, and a duct."""
    parts = []
    behind = min(hall.placed(-4.0, 0)[0], hall.stands[:, 0].min(initial=0) - 0.45)
    scale = hall.half_width[1] / PRESET_HALF_WIDTH
    for y0, y1 in ((-2.5 * scale, -0.72 * scale), (-0.66 * scale, 0.33 * scale), (0.39 * scale, 2.1 * scale)):
        vertices, faces = _sheet([behind, y0, HALL_FLOOR], [0, y1 - y0, 0], [0, 0, 3.0], 0.05)
        vertices[:, 0] += 0.02 * np.sin(vertices[:, 1] * rng.uniform(18, 26)) + 0.01 * np.sin(vertices[:, 1] * 61)
        parts.append(_Part(vertices, faces, SurfaceMaterial.CURTAIN, rng.uniform(0.16, 0.3)))
    for x, y, width in ((-3.2, 0.06, 0.04), (-3.5, 0.9, 0.02), (-3.4, 1.0, 0.02), (0.4, 3.4, 0.03), (-2.6, 3.0, 0.03)):
        place = hall.placed(x, y)
        if hall.is_free(place):
            low, high = [*place, HALL_FLOOR], [*(place + width), 2.4]
            parts += _block(low, high, SurfaceMaterial.METAL, 0.12, 0.5)
    foot = hall.placed(-2.35, 2.35)
    if hall.is_free(foot):
        parts.append(_duct(np.array([*foot, 0.0]), 0.13, 0.75))
    return parts


def _raised_box(sandbox: Sandbox, hall: Hall, rng: np.random.Generator) -> list[_Part]:
    """Return a raised black box on a tiled floor, next to a bright ball, as NASA's box of terrain 13."""
    tops = [sandbox.walls_m.get(side) or _RAISED_RIM for side in _SIDES]
    vertices, faces = icosphere(4)
    centre = [0.1, sandbox.half_width_m[1] + 0.35, HALL_FLOOR + 0.10]
    ball = _Part(vertices * 0.10 + centre, faces, SurfaceMaterial.METAL, 0.6, gloss=2.0)
    walls = _walls(sandbox.half_width_m, tops, _RAISED_THICKNESS, SurfaceMaterial.DARK, 0.04, rng)
    return [*walls, *_hall(hall, floor_albedo=0.35), ball]


def _hall(hall: Hall, floor_albedo: float = 0.05) -> list[_Part]:
    """Return the inner sides of a dark room that contains all lamps and tripods; outdoors only the floor."""
    low, high = np.array([*hall.placed(-5.5, -6.5), HALL_FLOOR]), np.array([*hall.placed(9.5, 6.0), 3.8])
    low[:2] = np.minimum(low[:2], hall.stands[:, :2].min(axis=0, initial=0) - 1)
    high = np.maximum(high, hall.stands.max(axis=0, initial=0) + 1)
    dx, dy, dz = high - low
    x0, y0, z0 = low
    sides = [
        _sheet([x0, y0, z0], [0, dy, 0], [0, 0, dz], 0.8), _sheet([high[0], y0, z0], [0, 0, dz], [0, dy, 0], 0.8),
        _sheet([x0, y0, z0], [0, 0, dz], [dx, 0, 0], 0.8), _sheet([x0, high[1], z0], [dx, 0, 0], [0, 0, dz], 0.8),
        _sheet([x0, y0, high[2]], [0, dy, 0], [dx, 0, 0], 0.8),
    ]  # fmt: skip
    floor = _Part(*_sheet(low.tolist(), [dx, 0, 0], [0, dy, 0], 0.25), SurfaceMaterial.FLOOR, floor_albedo)
    return [floor] if hall.is_open else [floor, *(_Part(*sheet, SurfaceMaterial.DARK, 0.03) for sheet in sides)]


def _duct(foot: np.ndarray, radius: float, height: float) -> _Part:
    """Return a ribbed, shiny tube."""
    vertices, faces = _sheet([0, 0, 0], [2 * np.pi, 0, 0], [0, 0, height], 0.04)
    angle, z = vertices[:, 0], vertices[:, 2]
    width = radius + 0.008 * np.sin(z * 150)
    tube = np.stack([width * np.cos(angle) + 0.25 * z, width * np.sin(angle) + 0.2 * z, z], axis=1) + foot
    return _Part(tube, faces, SurfaceMaterial.METAL, 0.35, gloss=1.0)
