"""Small scene with known boxes and shadows: flat sand, two blocks, two positions."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from polarsim.formats import obj, tables, yolo
from polarsim.geometry.heightfields import grid_mesh
from polarsim.geometry.meshes import Mesh
from polarsim.geometry.poses import camera_pose
from polarsim.labels.annotator import Annotator
from polarsim.labels.propagate import PropagationInputs
from polarsim.photo import NO_ROCK, PhotoKey
from polarsim.run_files import inventory, rigs
from polarsim.run_files.scene import TerrainMesh
from polarsim.site import polar
from tests.support.polar_photos import SIZE
from tests.support.polar_rig import default_rig

TERRAIN = 3
BLOCKS = {  # rock id -> centre of the base, and full extents, metres
    4: (np.array([0.4, -0.6, 0.0]), np.array([0.30, 0.30, 0.16])),
    7: (np.array([-0.8, 0.5, 0.0]), np.array([0.20, 0.24, 0.12])),
}


def block(centre: np.ndarray, size: np.ndarray, cells: int = 6) -> Mesh:
    """Return the mesh of a box with a grid of vertices on top and sides, open below."""
    t = np.linspace(-0.5, 0.5, cells + 1)
    u, v = np.meshgrid(t, t, indexing="ij")
    half = np.full_like(u, 0.5)
    sides = [(u, v, half), (half, u, v), (-half, v, u), (v, half, u), (u, -half, v)]
    vertices, faces = [], []
    corner = np.arange((cells + 1) ** 2).reshape(cells + 1, cells + 1)
    for number, side in enumerate(sides):
        points = np.stack([part.ravel() for part in side], axis=-1)
        points[:, 2] += 0.5
        vertices.append(centre + points * size)
        a, b, c, d = corner[:-1, :-1], corner[1:, :-1], corner[1:, 1:], corner[:-1, 1:]
        for three in ((a, b, c), (a, c, d)):
            faces.append(np.stack([k.ravel() for k in three], axis=-1) + number * (cells + 1) ** 2)
    return Mesh(np.concatenate(vertices), np.concatenate(faces))


def flat_ground(half: float = 2.1, step: float = 0.1, level: float = 0.0) -> Mesh:
    axis = np.arange(-half, half + step / 2, step)
    x, y = np.meshgrid(axis, axis)
    return grid_mesh(x, y, np.full_like(x, level))


def terrain_of(blocks: dict[int, tuple[np.ndarray, np.ndarray]]) -> TerrainMesh:
    """Return flat ground with blocks by rock id: centre of the base, and full extents, metres."""
    parts = [(NO_ROCK, flat_ground()), *((rock, block(*map(np.array, shape))) for rock, shape in blocks.items())]
    starts = np.cumsum([0, *(len(mesh.vertices) for _, mesh in parts)])
    return TerrainMesh(
        np.concatenate([mesh.vertices for _, mesh in parts]),
        np.concatenate([mesh.faces + start for (_, mesh), start in zip(parts, starts, strict=False)]),
        np.concatenate([np.full(len(mesh.faces), rock) for rock, mesh in parts]),
    )


def localised(position: str) -> rigs.LocalisedRig:
    centre, yaw = {"A": ([3.6, -0.4, 1.5], 178.0), "C": ([0.8, -3.8, 1.5], 103.0)}[position]
    return rigs.LocalisedRig(
        default_rig(), camera_pose(np.array(centre), np.radians(yaw), np.radians(25)), "labels", {}
    )


@dataclass(frozen=True)
class SceneFiles:
    """Input files of the labels stage."""

    photos: Path
    inventory: Path
    seeds: Path
    cameras: Path
    meshes: Path

    def inputs(self, keys: Sequence[PhotoKey], annotator: Annotator | None = None) -> PropagationInputs:
        """Return the input of the propagation to some photos."""
        files = (self.photos, self.inventory, self.seeds, self.cameras, self.meshes)
        return PropagationInputs(polar(), TERRAIN, keys, *files, annotator)

    def expected_box(self, position: str, camera: str, rock: int) -> np.ndarray:
        """Return the bounding box (4,) of the projected corners of a block."""
        corners = block(*BLOCKS[rock]).vertices
        pixels = localised(position).project(camera, corners)
        return np.concatenate([pixels.min(axis=0), pixels.max(axis=0)])


def build_scene(folder: Path) -> SceneFiles:
    """Write seeds of position A at azimuths 30 and 180 with both rocks and shadows; none for position C."""
    files = SceneFiles(*(folder / name for name in ("photos.parquet", "inventory.json", "seeds", "cameras", "meshes")))
    obj.write_obj(files.meshes / obj.ground_name(TERRAIN), flat_ground(), "ground")
    for rock, (centre, size) in BLOCKS.items():
        obj.write_obj(files.meshes / obj.rock_name(TERRAIN, rock), block(centre, size), f"rock{rock}")
    for position in "AC":
        rigs.write_localised(files.cameras / f"Pos{position}.json", localised(position))
    inventory.write_inventory(files.inventory, inventory.Inventory(TERRAIN, "release"))
    tables.write_parquet(files.photos, pd.DataFrame({name: [] for name in tables.PHOTO_COLUMNS}))
    rocks = np.array([files.expected_box("A", "L", rock) for rock in BLOCKS])
    shadows = {"30": np.array([-60, -40, -60, -40]), "180": np.array([0, 40, 0, 40])}
    for azimuth, offset in shadows.items():
        boxes = np.concatenate([rocks, rocks + offset])
        yolo.write_boxes(files.seeds / f"03_A_off_{azimuth}_L_0256.txt", np.array([0, 0, 1, 1]), boxes, size=SIZE)
    return files


@pytest.fixture
def scene(tmp_path) -> SceneFiles:
    """Return a new scene for tests that modify it."""
    return build_scene(tmp_path)


@pytest.fixture(scope="session")
def untouched_scene(tmp_path_factory) -> SceneFiles:
    return build_scene(tmp_path_factory.mktemp("scene"))
