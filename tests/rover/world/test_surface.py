"""Heights between nodes, and meshes of rocks."""

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from polarsim.errors import FormatError
from polarsim.formats.npz import read_arrays, write_arrays
from polarsim.rover.world.surface import (
    World,
    WorldBackdrop,
    bare_world,
    read_world,
    stored_arrays,
    write_world,
)


def test_heights_between_nodes_of_a_plane_are_on_the_plane(rng):
    columns, rows = np.meshgrid(-1 + 0.1 * np.arange(4), 2 + 0.1 * np.arange(3))
    x, y = rng.uniform(-1, -0.7, 50), rng.uniform(2, 2.2, 50)
    for a, b in ((1.5, -0.7), (-2.0, 0.0), (0.0, 1.0)):
        world = bare_world(a * columns + b * rows, 0.1, -1.0, 2.0)
        np.testing.assert_allclose(world.height_at(x, y), a * x + b * y, atol=1e-9)


def test_the_mesh_of_a_rock_reads_back(tmp_path):
    bare = bare_world(np.zeros((2, 2)), 1.0, 0.0, 0.0)
    vertices = np.arange(24, dtype=np.float32).reshape(8, 3)
    triangles = np.array([[0, 1, 2], [1, 2, 3], [4, 5, 6], [5, 6, 7]], np.int32)
    rocks = pd.DataFrame(
        {
            "rock": [0, 1], "terrain": 1, "rock_in_terrain": [3, 9], "x_m": 0.0, "y_m": 0.0, "height_m": 0.1,
            "width_m": 0.1, "radius_m": 0.1, "first_face": [0, 2], "faces": 2,
        }
    )  # fmt: skip
    write_world(tmp_path, World(bare.x0, bare.y0, bare.cell, bare.level, rocks, vertices, triangles))
    corners, faces = read_world(tmp_path).rock_mesh(1)
    np.testing.assert_array_equal(corners, vertices[4:])
    np.testing.assert_array_equal(faces, [[0, 1, 2], [1, 2, 3]])


@pytest.mark.parametrize(("file", "array"), [("ground.npz", "around_x_m"), ("rocks.npz", "scenery_triangles")])
def test_surroundings_with_a_missing_array_are_an_error(tmp_path, file, array):
    x, y = np.arange(3.0), np.arange(2.0)
    around = WorldBackdrop(x, y, np.zeros((2, 3), np.float32), *stored_arrays([]))
    write_world(tmp_path, replace(bare_world(np.zeros((2, 2)), 1.0, 0.0, 0.0), around=around))
    arrays = read_arrays(tmp_path / file, ())
    assert read_world(tmp_path).around is not None
    del arrays[array]
    write_arrays(tmp_path / file, **arrays)
    with pytest.raises(FormatError, match=array) as error:
        read_world(tmp_path)
    assert error.value.path == tmp_path
