"""Small terrain that can be checked by hand: level ground, a block as rock 1, a camera above."""

from dataclasses import replace

import numpy as np
import pytest

from polarsim.formats import obj
from polarsim.geometry.camera import Camera
from polarsim.geometry.lens import Lens
from polarsim.geometry.meshes import Mesh
from polarsim.geometry.poses import Pose, camera_pose
from polarsim.geometry.stereo import StereoRig
from polarsim.photo import NO_ROCK
from polarsim.render.olat import render_view
from polarsim.render.options import RenderOptions
from polarsim.render.surfaces import box_mesh, build_surfaces
from polarsim.render.twins import LabelPaths, render_twins
from polarsim.run_files import rigs
from polarsim.run_files.scene import TerrainMesh
from polarsim.run_files.walls import level_walls
from polarsim.site import polar

SIDE, HEIGHT = 0.4, 0.2  # metres, of the block
SMALL = Lens(220.0, 220.0, 100.0, 70.0, (-0.1, 0.15, 0.0005, -0.001, 0.0), width=200, height=140)
PLAIN = RenderOptions(walls=False, bounce=0, falloff=True)


def walled(mesh, half, height=0.28):
    """Return the terrain with walls around a square of half the width `half`, `height` above the sand."""
    return replace(mesh, walls=level_walls(half, mesh.sand_level + height))


def block(rock_ids=(1,), points=((0.0, 0.0),)):
    """Ground at z = 0, 4 m wide, and blocks SIDE x SIDE x HEIGHT on it."""
    ground = np.array([[-2, -2, 0], [2, -2, 0], [2, 2, 0], [-2, 2, 0]], float)
    vertices, faces, normals = [ground], [np.array([[0, 1, 2], [0, 2, 3]])], [np.tile([0.0, 0, 1], (4, 1))]
    rock_of_face = [np.full(2, NO_ROCK)]
    for rock, (x, y) in zip(rock_ids, points, strict=True):
        low = np.array([x - SIDE / 2, y - SIDE / 2, 0.0])
        v, f, n = box_mesh(low, low + np.array([SIDE, SIDE, HEIGHT]))
        faces.append(f + sum(len(part) for part in vertices))
        vertices.append(v)
        normals.append(n)
        rock_of_face.append(np.full(len(f), rock))
    return TerrainMesh(*(np.concatenate(parts) for parts in (vertices, faces, rock_of_face, normals)))


@pytest.fixture
def blocks():
    """`blocks(rock_ids, points)`: level ground with blocks 0.4 x 0.4 x 0.2 m on it."""
    return block


@pytest.fixture
def lens():
    return SMALL


@pytest.fixture
def plain():
    """Options without walls and without indirect light."""
    return PLAIN


@pytest.fixture
def camera():
    """Pose of a camera above and to the side of the block."""
    return camera_pose(np.array([2.5, -0.3, 1.8]), np.pi, np.radians(35))


@pytest.fixture
def above():
    """Pose of a camera directly above the block; image right is +X, image down is -Y."""
    return Pose(np.array([[1, 0, 0], [0, -1, 0], [0, 0, -1]], float), np.array([0, 0, 3.0]))


@pytest.fixture
def surfaces(plain):
    return build_surfaces(block(), plain)


@pytest.fixture
def ids_of():
    """`ids_of(surfaces, pose, lens, lamps)`: id maps by name of the lamp that casts the shadows."""

    def ids(surfaces, pose, lens, lamps, threads=1, options=PLAIN):
        return render_view(surfaces, Camera(pose, lens), lamps, [], sorted(lamps), options, threads).ids

    return ids


@pytest.fixture
def folders(tmp_path, camera, lens):
    """A terrain 1 on disk: meshes/ and cameras/PosA.json, photos of the small lens."""
    mesh = block()
    for rock, name in ((NO_ROCK, obj.ground_name(1)), (1, obj.rock_name(1, 1))):
        faces = mesh.faces[mesh.rock_of_face == rock]
        used, numbers = np.unique(faces, return_inverse=True)
        obj.write_obj(tmp_path / "meshes" / name, Mesh(mesh.vertices[used], numbers.reshape(-1, 3)), "part")
    rig = StereoRig(lens, lens, Pose(np.eye(3), np.array([0.3, 0, 0])))
    rigs.write_localised(tmp_path / "cameras" / "PosA.json", rigs.LocalisedRig(rig, camera, "test"))
    return tmp_path


def render_into(folders, twins, keys, options, labels="labels", **others):
    """Render the twins of the terrain in `folders` by model; write labels and maps to `folders / labels`."""
    files = ("boxes", "instances", "coco.json", "table.parquet", "maps")
    given = {
        "site": polar(),
        "terrain": 1,
        "cameras": folders / "cameras",
        "meshes": folders / "meshes",
        "photos": None,
        "threads": 1,
        "labels": LabelPaths(*(folders / labels / name for name in files)),
    }
    render_twins(twins=twins, keys=keys, options=options, **given | others)
