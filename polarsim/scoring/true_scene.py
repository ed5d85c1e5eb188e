"""True cameras, lamps and meshes of the analog in the frame of a run, for the ablation.

Only the scoring package may read ground truth. Twins rendered from these files are evaluated by the ablation only.
"""

from __future__ import annotations

import shutil
from pathlib import Path

import numpy as np

from polarsim.formats import obj
from polarsim.formats.files import read_json, writing_folder
from polarsim.formats.tables import read_parquet
from polarsim.geometry.meshes import Mesh
from polarsim.photo import NO_ROCK, Terrain
from polarsim.run_files.lamps import write_suns
from polarsim.run_files.rigs import LocalisedRig, read_all_localised, write_localised
from polarsim.run_files.scene import mesh_files, read_terrain
from polarsim.run_files.walls import read_walls, write_walls
from polarsim.scoring.rock_pairs import pair_rocks
from polarsim.scoring.true_surface import compare_surfaces
from polarsim.site import Site

_CENTRES = ("rock", "x", "y", "z", "size_m")


def write_true_scene(
    *,
    site: Site,
    terrain: Terrain,
    rocks: Path,
    meshes: Path,
    located: Path,
    inventory: Path,
    truth: Path,
    true_cameras: Path,
    true_meshes: Path,
) -> None:
    """Write the true `PosX.json`, `lamps.json` and meshes of a terrain in the frame of the run.

    The frame aligns the meshes of the run with the true surface (`true_surface.compare_surfaces`). True rocks have the
    id of the matched rock of the run, so that they can be matched with labels; unmatched rocks have new ids. The walls
    are those of the run. `located` has the poses for which the meshes were reconstructed, `truth` is the folder
    truth/TerrainTT of the analog.
    """
    sandbox = site.sandbox_of(terrain)
    scene = read_terrain(meshes, terrain, sandbox)
    truth_from_sandbox = compare_surfaces(sandbox, terrain, scene, located, truth, inventory).truth_from_sandbox
    sandbox_from_truth = truth_from_sandbox.inverse()
    true, found = (read_parquet(path, _CENTRES) for path in (truth / "rocks.parquet", rocks))
    pairs = pair_rocks(true, found, truth_from_sandbox)
    number = dict(zip(true["rock"].iloc[pairs.true], found["rock"].iloc[pairs.found], strict=True))
    unpaired = sorted(set(true["rock"]) - set(number))
    number |= dict(zip(unpaired, range(max([*found["rock"], 0]) + 1, 2**31), strict=False))
    with writing_folder(true_cameras) as folder:
        for position, rig in read_all_localised(truth / "cameras").items():
            localised = LocalisedRig(rig.rig, sandbox_from_truth @ rig.sandbox_from_left, "truth")
            write_localised(folder / f"Pos{position}.json", localised)
        lamps = read_json(truth / "lamps.json")  # the rover light is part of the rig
        suns = {sun: np.array(lamps[sun], float) for sun in site.suns if sun in lamps}
        write_suns(folder, {sun: sandbox_from_truth.apply(position) for sun, position in suns.items()})
    with writing_folder(true_meshes) as folder:
        for rock, path in mesh_files(truth / "meshes", terrain).items():
            name = obj.ground_name(terrain) if rock == NO_ROCK else obj.rock_name(terrain, int(number[rock]))
            mesh = obj.read_obj(path)
            moved = Mesh(sandbox_from_truth.apply(mesh.vertices), mesh.faces)
            obj.write_obj(folder / name, moved, Path(name).stem)
        _copy_walls(meshes, folder)


def thin_meshes(*, terrain: Terrain, meshes: Path, thinned: Path) -> None:
    """Write a folder with the ground, the walls and only the decimated copies of the rocks of a run."""
    with writing_folder(thinned) as folder:
        for rock, path in mesh_files(meshes, terrain).items():
            copy = path if rock == NO_ROCK else meshes / obj.rock_name(terrain, rock, decimated=True)
            source = copy if copy.exists() else path  # some published rocks have no decimated copy
            shutil.copyfile(source, folder / source.name)
        _copy_walls(meshes, folder)


def _copy_walls(meshes: Path, folder: Path) -> None:
    """Copy the walls of a run, so that the ablation replaces the meshes only."""
    walls = read_walls(meshes)
    if walls is not None:
        write_walls(folder, walls)
