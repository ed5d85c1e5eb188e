import numpy as np
import pytest

from polarsim.render.lamps import Lamp
from polarsim.render.olat import NO_LAMP
from polarsim.render.surfaces import add_skirts, build_surfaces, low_open_edges, skirt_strips
from polarsim.run_files.scene import TerrainMesh

GAP = 0.03  # metres between the ground and the open base of the block


@pytest.fixture
def floating(blocks):
    """Block without underside, above the ground; the sides share no vertices."""
    mesh = blocks()
    below = (mesh.vertices[mesh.faces][:, :, 2] == 0).all(axis=1) & (mesh.rock_of_face == 1)
    vertices = mesh.vertices + np.where(np.arange(len(mesh.vertices)) >= 4, GAP, 0.0)[:, None] * [0, 0, 1]
    return TerrainMesh(vertices, mesh.faces[~below], mesh.rock_of_face[~below], mesh.normals)


def test_open_edges_of_a_block_without_underside_exclude_seams(floating):
    rim = low_open_edges(floating.vertices, floating.faces[floating.rock_of_face == 1])
    assert len(rim) == 4
    np.testing.assert_allclose(floating.vertices[rim][:, :, 2], GAP)
    lengths = np.linalg.norm(floating.vertices[rim[:, 1]] - floating.vertices[rim[:, 0]], axis=1)
    np.testing.assert_allclose(lengths, 0.4)


def test_skirts_face_the_same_side_as_the_faces_above_and_closed_rocks_have_none(blocks):
    start, end = np.array([[0.0, 0, 1]]), np.array([[1.0, 0, 1]])  # under a face with the third corner (0, 0, 2)
    vertices, faces, normals = skirt_strips(start, end, 0.1)
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    flat = np.cross(b - a, c - a)
    np.testing.assert_allclose(flat / np.linalg.norm(flat, axis=1, keepdims=True), [[0, -1, 0]] * 2)
    np.testing.assert_allclose(normals, [[0, -1, 0]] * 4)
    assert vertices[:, 2].min() == 0.9
    assert len(add_skirts(blocks(), 0.05).faces) == len(blocks().faces)


def test_skirts_prevent_light_leaks(floating, camera, lens, plain, ids_of):
    lamp = Lamp(np.array([-3.5, 0.0, 0.1]))  # low, opposite the camera: shines through the gap
    for depth, leaks in ((0.0, True), (0.05, False)):
        surfaces = build_surfaces(floating, plain.model_copy(update={"skirt_m": depth}))
        ids = ids_of(surfaces, camera, lens, {"sun": lamp})
        edge = lens.project(camera.inverse().apply(np.array([0.23, 0.0, 0.0])))  # ground in front of the block
        column, row = np.floor(edge).astype(int)
        assert (ids["sun"][row, column] == 1) == leaks
        if not leaks:
            assert (ids[NO_LAMP][row - 4, column]) == 1001  # the skirt is part of the rock
