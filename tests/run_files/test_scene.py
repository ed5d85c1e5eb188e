import numpy as np
import pytest

from polarsim.errors import FormatError
from polarsim.formats import obj
from polarsim.geometry.meshes import Mesh
from polarsim.photo import NO_ROCK
from polarsim.run_files.scene import TerrainMesh, read_terrain, terrain_of_folder
from polarsim.run_files.walls import THICKNESS_M, Walls, level_walls, write_walls
from tests.support.polar_survey import SANDBOX

TRIANGLE = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0]], float)
FACE = np.array([[0, 1, 2]])


def test_each_face_has_the_rock_and_position_of_the_mesh(tmp_path):
    obj.write_obj(tmp_path / "terrain04_ground.obj", Mesh(TRIANGLE, FACE), "ground")
    obj.write_obj(tmp_path / "terrain04_rock7.obj", Mesh(TRIANGLE + 2, FACE), "rock7")
    obj.write_obj(tmp_path / "terrain04_rock3.obj", Mesh(TRIANGLE + 1, FACE), "rock3")
    terrain = read_terrain(tmp_path, 4, SANDBOX)
    assert terrain.rocks == [3, 7]
    assert terrain.rock_of_face.tolist() == [NO_ROCK, 3, 7]
    np.testing.assert_allclose(terrain.vertices[terrain.faces[1]], TRIANGLE + 1)
    np.testing.assert_allclose(terrain.rock_vertices(7), TRIANGLE + 2)
    np.testing.assert_allclose(terrain.normals, np.tile([0, 0, 1], (9, 1)))


@pytest.mark.parametrize("cell_m", [0.005, 0.02, 2.055])
def test_fine_ground_ends_in_the_walls_and_coarse_ground_keeps_its_shape(tmp_path, cell_m):
    half = 2.055
    along = np.linspace(-half, half, round(2 * half / cell_m) + 1)
    vertices = np.stack([*np.meshgrid(along, along), np.zeros((len(along), len(along)))], axis=-1).reshape(-1, 3)
    corner = np.arange(len(vertices)).reshape(len(along), -1)
    a, b, c, d = (part.ravel() for part in (corner[:-1, :-1], corner[:-1, 1:], corner[1:, 1:], corner[1:, :-1]))
    ground = Mesh(vertices, np.concatenate([np.column_stack([a, b, c]), np.column_stack([a, c, d])]))
    rock = Mesh(TRIANGLE + np.array([half, 0, 0]), FACE)
    obj.write_obj(tmp_path / "terrain04_ground.obj", ground, "ground")
    obj.write_obj(tmp_path / "terrain04_rock3.obj", rock, "rock3")
    walls = level_walls(2.0, 0.28)
    write_walls(tmp_path, Walls({side: wall for side, wall in walls.sides.items() if side != "+y"}, "scans", {"+y": 2}))
    terrain = read_terrain(tmp_path, 4, SANDBOX)
    part = terrain.part(NO_ROCK).vertices
    ends = np.abs([part[:, 0].min(), part[:, 0].max(), part[:, 1].min()])
    if cell_m < THICKNESS_M / 2:
        assert (ends > 2.0).all()
        assert (ends < 2.0 + THICKNESS_M).all()
    else:
        np.testing.assert_allclose(ends, half)
    assert part[:, 1].max() == pytest.approx(half)  # no wall
    np.testing.assert_allclose(terrain.rock_vertices(3), rock.vertices, atol=1e-6)


def test_a_folder_without_ground_is_an_error(tmp_path):
    with pytest.raises(FormatError, match=r"terrain04_ground\.obj"):
        read_terrain(tmp_path, 4, SANDBOX)


def test_the_ground_mesh_has_the_number_of_the_terrain(tmp_path):
    with pytest.raises(FormatError):
        terrain_of_folder(tmp_path)
    obj.write_obj(tmp_path / "terrain11_ground.obj", Mesh(TRIANGLE, FACE), "ground")
    obj.write_obj(tmp_path / "terrain11_rock3.obj", Mesh(TRIANGLE, FACE), "rock3")
    assert terrain_of_folder(tmp_path) == 11
    obj.write_obj(tmp_path / "terrain04_ground.obj", Mesh(TRIANGLE, FACE), "ground")
    with pytest.raises(FormatError, match=r"found terrain04_ground\.obj"):
        terrain_of_folder(tmp_path)


def test_given_normals_replace_normals_of_triangles():
    given = np.tile([1.0, 0, 0], (3, 1))
    rock_of_face = np.array([NO_ROCK])
    assert TerrainMesh(TRIANGLE, FACE, rock_of_face, given).normals is given
    np.testing.assert_allclose(TerrainMesh(TRIANGLE, FACE, rock_of_face).normals, np.tile([0, 0, 1], (3, 1)))
