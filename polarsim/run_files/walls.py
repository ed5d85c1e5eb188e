"""`walls.json` next to the meshes of a terrain: inner face and top edge of each wall of the sandbox."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Literal, get_args

import numpy as np

from polarsim.errors import FormatError, with_path
from polarsim.formats.files import read_json, write_json
from polarsim.formats.readers import reader
from polarsim.survey import half_width, wall_height

FILE = "walls.json"
Side = Literal["-x", "+x", "-y", "+y"]
SIDES: tuple[Side, ...] = get_args(Side)
Origin = Literal["scans", "survey"]
STRIP_M = 0.10  # width of the strips along a wall with one height each


@dataclass(frozen=True)
class Wall:
    """Wall on one side of the sandbox, sandbox frame, metres."""

    face_m: float  # distance of the inner face from the origin
    along_m: np.ndarray  # (s,) centres of the strips along the wall, ascending
    top_m: np.ndarray  # (s,) height of the top edge of each strip
    support: float  # share of the strips with scanned points; 0: nominal wall

    def top(self, along: np.ndarray) -> np.ndarray:
        """Return the height (n,) of the top edge at coordinates (n,) along the wall."""
        return np.interp(along, self.along_m, self.top_m)


@dataclass(frozen=True)
class Walls:
    """The four walls of a sandbox, and the origin of their measurements."""

    sides: Mapping[Side, Wall]
    origin: Origin


def strips(half: float) -> np.ndarray:
    """Return the centres (s,) of the strips along a wall of a sandbox with a half width, metres."""
    count = round(2 * half / STRIP_M)
    return (np.arange(count) + 0.5) * STRIP_M - count * STRIP_M / 2


def surveyed_walls(terrain: int, level: float) -> Walls | None:
    """Return NASA's nominal walls above sand at a height of `level` metres; None for a sandbox without survey."""
    height, half = wall_height(terrain), half_width(terrain)
    if not height:
        return None
    along = strips(half)
    wall = Wall(half, along, np.full(len(along), level + height), 0.0)
    return Walls(dict.fromkeys(SIDES, wall), "survey")


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
    write_json(Path(folder) / FILE, {"origin": walls.origin, "sides": sides})


@reader("walls")
def read_walls(folder: str | Path) -> Walls | None:
    """Read the walls of a folder of meshes; None if the folder has no such file: a sandbox without walls."""
    path = Path(folder) / FILE
    if not path.exists():
        return None
    content = read_json(path)
    with with_path(path):
        try:
            sides = {side: _wall(content["sides"][side]) for side in SIDES}
            if content["origin"] not in get_args(Origin):
                raise ValueError(f"origin {content['origin']!r}")
        except (KeyError, TypeError, ValueError) as error:
            raise FormatError(
                f"expected origin and {', '.join(SIDES)} with face_m, support, along_m, top_m: {error!r}"
            ) from error
        return Walls(sides, content["origin"])


def _wall(content: Mapping[str, object]) -> Wall:
    along, top = (np.array(content[name], float) for name in ("along_m", "top_m"))
    face, support = float(content["face_m"]), float(content["support"])  # type: ignore[arg-type]
    if along.shape != top.shape or along.ndim != 1 or not len(along) or not (np.diff(along) > 0).all():
        raise ValueError("along_m and top_m differ in length or are not ascending")
    if not (np.isfinite(top).all() and np.isfinite(along).all() and face > 0):
        raise ValueError("a value is not finite, or a face is not beyond the origin")
    return Wall(face, along, top, support)
