"""File names of the meshes of a terrain, as in the release. Contents are read by `obj`, which imports NumPy."""

from __future__ import annotations

import re
from pathlib import Path

from polarsim.photo import Terrain, parse_terrain, terrain_text

_ROCK_NAME = re.compile(r"terrain(\d{2,}|[A-Za-z0-9-]*[A-Za-z][A-Za-z0-9-]*)_rock(\d+)(_decimate-005)?\.obj")


def rock_name(terrain: Terrain, rock: int, *, decimated: bool = False) -> str:
    """File name of a rock, `terrain01_rock3.obj`."""
    return f"terrain{terrain_text(terrain)}_rock{rock}{'_decimate-005' if decimated else ''}.obj"


GROUND_PATTERN = "terrain*_ground.obj"


def ground_name(terrain: Terrain) -> str:
    return f"terrain{terrain_text(terrain)}_ground.obj"


def parse_rock_name(name: str) -> tuple[Terrain, int, bool] | None:
    """Return the terrain, the rock id and whether the mesh is decimated; None for names of other files."""
    match = _ROCK_NAME.fullmatch(name)
    return (parse_terrain(match[1]), int(match[2]), match[3] is not None) if match else None


def rock_files(folder: str | Path) -> dict[int, Path]:
    """Return the rock meshes of a folder by rock id; the decimated mesh only if the full mesh is missing."""
    files: dict[int, Path] = {}
    for path in sorted(Path(folder).glob("*.obj")):
        parsed = parse_rock_name(path.name)
        if parsed and (not parsed[2] or parsed[1] not in files):
            files[parsed[1]] = path
    return dict(sorted(files.items()))
