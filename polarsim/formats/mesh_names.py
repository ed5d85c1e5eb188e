"""File names of the meshes of a terrain, as in the release. Contents are read by `obj`, which imports NumPy."""

from __future__ import annotations

import re
from pathlib import Path

from polarsim.photo import Terrain, terrain_of_text, terrain_text

_TERRAIN = r"terrain([A-Za-z0-9-]+)"
_ROCK_NAME = re.compile(rf"{_TERRAIN}_rock(\d+)(_decimate-005)?\.obj")
_GROUND_NAME = re.compile(rf"{_TERRAIN}_ground\.obj")


def rock_name(terrain: Terrain, rock: int, *, decimated: bool = False) -> str:
    """File name of a rock, `terrain01_rock3.obj`."""
    return f"terrain{terrain_text(terrain)}_rock{rock}{'_decimate-005' if decimated else ''}.obj"


GROUND_PATTERN = "terrain*_ground.obj"


def ground_name(terrain: Terrain) -> str:
    return f"terrain{terrain_text(terrain)}_ground.obj"


def parse_rock_name(name: str) -> tuple[Terrain, int, bool] | None:
    """Return the terrain, the rock id and whether the mesh is decimated; None for names of other files."""
    match = _ROCK_NAME.fullmatch(name)
    terrain = terrain_of_text(match[1]) if match else None
    return None if match is None or terrain is None else (terrain, int(match[2]), match[3] is not None)


def terrain_of_mesh(name: str) -> Terrain | None:
    """Return the terrain in the file name of a mesh; None for names of other files."""
    match = _ROCK_NAME.fullmatch(name) or _GROUND_NAME.fullmatch(name)
    return terrain_of_text(match[1]) if match else None


def rock_files(folder: str | Path) -> dict[int, Path]:
    """Return the rock meshes of a folder by rock id; the decimated mesh only if the full mesh is missing."""
    files: dict[int, Path] = {}
    for path in sorted(Path(folder).glob("*.obj")):
        parsed = parse_rock_name(path.name)
        if parsed and (not parsed[2] or parsed[1] not in files):
            files[parsed[1]] = path
    return dict(sorted(files.items()))
