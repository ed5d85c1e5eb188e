"""Small scene of separate rocks on sand, as meshes: a scene for first renderings, without photos and scans."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from polarsim.analog.ground import make_ground, pile_sand
from polarsim.analog.placement import place_rocks
from polarsim.analog.presets import Preset
from polarsim.analog.rocks import icosphere
from polarsim.analog.truth import faces_above_sand
from polarsim.formats import obj
from polarsim.geometry.meshes import Mesh
from polarsim.randomness import generator
from polarsim.site_parts import Sandbox

TERRAIN = 1  # number in the names of the mesh files
_PRESET = Preset(14, (0.10, 0.22, 0.46), touching=0.0, pits=5, mounds=4)  # no contacts, which would need Open3D
_SANDBOX = Sandbox(half_width_m=(2.0, 2.0))
_GROUND_STEP = 0.02  # metres
_DETAIL = 4  # subdivisions of the icosahedron of a rock


def write_rock_scene(folder: Path, seed: int) -> None:
    """Write the meshes of the ground and of 14 rocks, generated from a seed, in the layout of a run's mesh folder."""
    ground = make_ground(_PRESET, _SANDBOX.half_width_m, _GROUND_STEP, generator(seed, "ground", TERRAIN))
    rocks = place_rocks(_PRESET, _SANDBOX, ground, generator(seed, "rocks", TERRAIN), _DETAIL)
    centres = np.array([rock.centre[:2] for rock in rocks])
    radii = np.array([rock.radius for rock in rocks])
    ground = pile_sand(ground, generator(seed, "piles", TERRAIN), centres, radii)
    meshes = {obj.ground_name(TERRAIN): Mesh(*ground.mesh())}
    for rock in rocks:
        faces = faces_above_sand(rock, ground, icosphere(_DETAIL)[1], below=0.01)
        used, index = np.unique(faces, return_inverse=True)
        meshes[obj.rock_name(TERRAIN, rock.rock)] = Mesh(rock.vertices[used], index.reshape(faces.shape))
    for name, mesh in meshes.items():
        obj.write_obj(folder / name, mesh, Path(name).stem)
