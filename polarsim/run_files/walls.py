"""`walls.json` next to the meshes of a terrain: inner face and top edge of each wall of the sandbox.

A sandbox has walls on any sides. A side without wall has only a border, where the sand ends.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Literal, get_args

import numpy as np

from polarsim.errors import FormatError, with_path
from polarsim.formats.files import read_json, write_json
from polarsim.formats.readers import reader
from polarsim.site_parts import Sandbox, Side

FILE = "walls.json"
SIDES: tuple[Side, ...] = get_args(Side)
Origin = Literal["scans", "photos", "survey"]
STRIP_M = 0.10  # width of the strips along a wall with one height each
THICKNESS_M = 0.05
WALL_FOOT_M = 0.5  # depth of the walls below the median sand, metres
# Distance of the inner faces from the border of the sand, and of the top edges below the stated height, without
# measurements: best of 12 pairs on five of six published cover photos of POLAR. The second is also a safety margin for
# objects that must not exceed any wall: 1 cm for the lowest wall, 1 cm for the sand level (a median).
FACE_BEYOND_SAND_M, WALL_MARGIN = 0.05, 0.02


@dataclass(frozen=True)
class Wall:
    """Wall on one side of the sandbox, sandbox frame, metres."""

    face_m: float  # distance of the inner face from the origin
    along_m: np.ndarray  # (s,) centres of the strips along the wall, ascending
    top_m: np.ndarray  # (s,) height of the top edge of each strip
    support: float  # share of the strips with scanned points, or points of the shadow edge in photos; 0: nominal wall

    def top(self, along: np.ndarray) -> np.ndarray:
        """Return the height (n,) of the top edge at coordinates (n,) along the wall."""
        return np.interp(along, self.along_m, self.top_m)


@dataclass(frozen=True)
class Walls:
    """The walls of a sandbox, and the origin of their measurements."""

    sides: Mapping[Side, Wall]
    origin: Origin
    open_m: Mapping[Side, float] = field(default_factory=dict)  # distance of the border at each side without wall

    @property
    def bounds(self) -> np.ndarray:
        """(2, 2) minimum and maximum x, y of the floor between inner faces and borders without wall."""
        low_x, high_x, low_y, high_y = (
            self.sides[side].face_m if side in self.sides else self.open_m[side] for side in SIDES
        )
        return np.array([[-low_x, -low_y], [high_x, high_y]])

    def clearance(self, points: np.ndarray, lamp: np.ndarray) -> np.ndarray:
        """Return the height (n,) above the top edge at which rays from points (n, 3) to a lamp (3,) cross a wall.

        Negative: the wall shades the point. Infinite: the ray crosses no wall.
        """
        position = np.ascontiguousarray(points.T)  # (3, n): operations on short rows are slow
        to_lamp = lamp[:, None] - position
        low, high = self.bounds[..., None]
        limits = np.where(to_lamp[:2] > 0, high, low)
        with np.errstate(divide="ignore", invalid="ignore"):
            shares = (limits - position[:2]) / to_lamp[:2]
        along_x, along_y = np.where(shares >= 0, shares, np.inf)
        share = np.minimum(along_x, along_y)
        clear = np.full(len(points), np.inf)
        for number, side in enumerate(SIDES):
            if side not in self.sides:
                continue
            first = along_x <= along_y if number < 2 else along_y < along_x
            towards = (to_lamp[number // 2] > 0) == (number % 2 == 1)
            crossed = np.flatnonzero(first & towards & (share < 1))
            at = position[:, crossed] + share[crossed] * to_lamp[:, crossed]
            clear[crossed] = at[2] - self.sides[side].top(at[1 - number // 2])
        return clear

    def mesh(self, foot: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return vertices (v, 3), faces (f, 3) and vertex normals (v, 3) of the walls, down to a height of `foot`.

        Inner face, top and outer face share no vertices: edges are sharp.
        """
        low, high = self.bounds
        corner = [THICKNESS_M if side in self.sides else 0.0 for side in ("-y", "+y")]
        ends = {"x": (low[1] - corner[0], high[1] + corner[1]), "y": (low[0], high[0])}
        parts = [_board(side, wall, ends[side[1]], foot) for side, wall in self.sides.items()]
        starts = np.cumsum([0, *(len(vertices) for vertices, _, _ in parts)])
        faces = [faces + start for (_, faces, _), start in zip(parts, starts, strict=False)]
        return np.concatenate([part[0] for part in parts]), np.concatenate(faces), np.concatenate([p[2] for p in parts])


def _board(side: Side, wall: Wall, ends: tuple[float, float], foot: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return vertices, faces and normals of one wall: inner face, top, outer face and both ends."""
    axis, sign = "xy".index(side[1]), -1.0 if side[0] == "-" else 1.0
    inner = wall.along_m[(wall.along_m > ends[0]) & (wall.along_m < ends[1])]
    along = np.array([ends[0], *inner, ends[1]])
    top, low = wall.top(along), np.full(len(along), foot)

    def line(outward: float, at: np.ndarray, height: np.ndarray) -> np.ndarray:
        points = np.empty((len(at), 3))
        points[:, axis], points[:, 1 - axis], points[:, 2] = sign * outward, at, height
        return points

    face, back = wall.face_m, wall.face_m + THICKNESS_M
    towards = sign * np.eye(3)[axis]
    sheets = [
        (line(face, along, low), line(face, along, top), -towards),
        (line(face, along, top), line(back, along, top), np.array([0.0, 0.0, 1.0])),
        (line(back, along, low), line(back, along, top), towards),
    ]
    for number, end in ((0, -1.0), (-1, 1.0)):
        lower, upper = (
            np.concatenate([line(x, along[[number]], z[[number]]) for x in (face, back)]) for z in (low, top)
        )
        sheets.append((lower, upper, end * np.eye(3)[1 - axis]))
    vertices, faces, normals, count = [], [], [], 0
    for first, second, normal in sheets:
        start = np.arange(len(first) - 1)
        quads = np.column_stack([start, start + 1, start + 1 + len(first), start + len(first)]) + count
        if np.cross(first[1] - first[0], second[0] - first[0]) @ normal < 0:
            quads = quads[:, ::-1]
        faces += [quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]]
        vertices += [first, second]
        normals.append(np.tile(normal, (2 * len(first), 1)))
        count += 2 * len(first)
    return np.concatenate(vertices), np.concatenate(faces), np.concatenate(normals)


def level_walls(face_m: float, top_m: float, origin: Origin = "survey") -> Walls:
    """Return walls around a square floor: distance of the inner faces from the origin, and height of the top edges."""
    return _level_walls((face_m, face_m), dict.fromkeys(SIDES, top_m), origin)


def _level_walls(border_m: tuple[float, float], tops_m: Mapping[Side, float], origin: Origin) -> Walls:
    """Return level walls at distances from the origin along X and Y, with the height of the top edge of each side."""
    sides: dict[Side, Wall] = {}
    for number, side in enumerate(SIDES):
        if side in tops_m:
            along = wall_strips(border_m[1 - number // 2])
            sides[side] = Wall(border_m[number // 2], along, np.full(len(along), tops_m[side]), 0.0)
    open_m = {side: border_m[number // 2] for number, side in enumerate(SIDES) if side not in sides}
    return Walls(sides, origin, open_m)


def wall_strips(half: float) -> np.ndarray:
    """Return the centres (s,) of the strips along a wall of a sandbox with a half width, metres."""
    count = round(2 * half / STRIP_M)
    return (np.arange(count) + 0.5) * STRIP_M - count * STRIP_M / 2


def surveyed_walls(sandbox: Sandbox, level: float) -> Walls | None:
    """Return the walls that the site states, above sand at a height of `level` metres; None without walls."""
    heights = {side: round(height - WALL_MARGIN, 4) for side in SIDES if (height := sandbox.walls_m.get(side))}
    if not heights:
        return None
    x, y = sandbox.half_width_m
    faces = x + FACE_BEYOND_SAND_M, y + FACE_BEYOND_SAND_M
    walls = _level_walls(faces, {side: level + height for side, height in heights.items()}, "survey")
    return replace(walls, open_m={side: (y if side.endswith("y") else x) for side in walls.open_m})


def flat_walls(sandbox: Sandbox, level: float) -> Walls:
    """Return walls on all sides that end at the sand, at a height of `level` metres."""
    return _level_walls(sandbox.half_width_m, dict.fromkeys(SIDES, level), "survey")


def surely_wall(sandbox: Sandbox) -> float:
    """Return the minimum height of all walls above the sand, metres; 0 if a side has no wall."""
    return lowest_wall(sandbox) if sandbox.is_walled else 0.0


def lowest_wall(sandbox: Sandbox) -> float:
    """Return the minimum height of the existing walls above the sand, metres; 0 without walls."""
    heights = [height for side in SIDES if (height := sandbox.walls_m.get(side))]
    return max(0.0, round(min(heights, default=0.0) - WALL_MARGIN, 4))


def write_walls(folder: str | Path, walls: Walls) -> None:
    """Write walls, rounded to 0.1 mm."""
    sides = {
        side: {
            "face_m": round(wall.face_m, 4),
            "support": round(wall.support, 2),
            "along_m": np.round(wall.along_m, 4).tolist(),
            "top_m": np.round(wall.top_m, 4).tolist(),
        }
        for side, wall in walls.sides.items()
    }
    borders = {side: round(border, 4) for side, border in walls.open_m.items()}
    open_sides = {"open_m": borders} if borders else {}
    write_json(Path(folder) / FILE, {"origin": walls.origin, "sides": sides, **open_sides})


def walls_file(meshes: Path, cameras: Path | None) -> Path | None:
    """Return the file of walls fitted to photos, in the folder of the rig poses, else measured, of the meshes."""
    folders = [folder for folder in (cameras, meshes) if folder is not None]
    return next((path for folder in folders if (path := folder / FILE).exists()), None)


@reader("walls")
def read_walls(folder: str | Path) -> Walls | None:
    """Read the walls of a folder of meshes; None if the folder has no such file: a sandbox without walls."""
    path = Path(folder) / FILE
    if not path.exists():
        return None
    content = read_json(path)
    with with_path(path):
        try:
            open_m = {side: float(content["open_m"][side]) for side in SIDES if side in content.get("open_m", {})}
            sides = {side: _wall(content["sides"][side]) for side in SIDES if side not in open_m}
            if not all(np.isfinite(border) and border > 0 for border in open_m.values()):
                raise ValueError(f"open_m {open_m}")
            if content["origin"] not in get_args(Origin):
                raise ValueError(f"origin {content['origin']!r}")
        except (KeyError, TypeError, ValueError) as error:
            raise FormatError(
                f"expected origin and {', '.join(SIDES)} with face_m, support, along_m, top_m: {error!r}"
            ) from error
        return Walls(sides, content["origin"], open_m)


def _wall(content: Mapping[str, object]) -> Wall:
    along, top = (np.array(content[name], float) for name in ("along_m", "top_m"))
    face, support = float(content["face_m"]), float(content["support"])  # type: ignore[arg-type]
    if along.shape != top.shape or along.ndim != 1 or not len(along) or not (np.diff(along) > 0).all():
        raise ValueError("along_m and top_m differ in length or are not ascending")
    if not (np.isfinite(top).all() and np.isfinite(along).all() and face > 0):
        raise ValueError("a value is not finite, or a face is not beyond the origin")
    return Wall(face, along, top, support)
