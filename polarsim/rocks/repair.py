"""Closed copies of published rock meshes, and a table of what was wrong with them."""

from __future__ import annotations

import logging
from pathlib import Path

import numpy as np

from polarsim.errors import ReconstructionError, about
from polarsim.formats import obj, tables
from polarsim.formats.files import writing_folder
from polarsim.formats.inventory import read_inventory
from polarsim.formats.ply import Cloud
from polarsim.formats.rigs import read_all_placed
from polarsim.formats.scene import PUBLISHED
from polarsim.progress import track
from polarsim.rocks.defects import FILE, defect_table, repaired
from polarsim.rocks.folder import write_named
from polarsim.rocks.mesh import ground_heights
from polarsim.rocks.options import RocksOptions
from polarsim.rocks.rims import FITTED_GROUND_CELL

log = logging.getLogger("polarsim")


def repair_rocks(
    *, terrain: int, inventory: Path, cameras: Path, meshes: Path, copies: Path, options: RocksOptions
) -> None:
    """Write `copies`: a watertight OBJ file a rock, `meshes.csv`, and `defects.csv` of the rocks as published.

    Parameters
    ----------
    meshes : Path
        Folder of the terrain's adopted rocks and their ground.

    A rock whose surface spans no volume is a warning and a gap.
    """
    with about(inventory):
        published = {rock: obj.read(path) for rock, path in read_inventory(inventory).rock_meshes().items()}
    ground = obj.read(meshes / obj.ground_name(terrain)).vertices
    grid, heights = ground_heights(Cloud(ground, np.zeros_like(ground)), FITTED_GROUND_CELL)
    rigs = read_all_placed(cameras).values()
    scanners = np.array([rig.sandbox_from_left.translation for rig in rigs]).reshape(-1, 3)
    closed = {}
    for rock, path in track(list(obj.rock_files(meshes).items()), f"repair of terrain {terrain:02d}"):
        try:
            copy = repaired(obj.read(path), grid, heights, scanners, options.rock_cell_mm / 1000)
        except ReconstructionError as error:
            log.warning("terrain %02d, rock %d cannot be closed: %s", terrain, rock, error)
            continue
        closed[obj.rock_name(terrain, rock)] = copy
    with writing_folder(copies) as folder:
        write_named(folder, closed, dict.fromkeys(closed, PUBLISHED))
        tables.write_csv(folder / FILE, defect_table(published))
