import numpy as np

from polarsim.geometry.camera import Camera
from polarsim.render.hits import cast_strip
from polarsim.render.options import RenderOptions
from polarsim.render.surfaces import Surfaces, box_mesh, build_surfaces
from polarsim.run_files.instances import BACKGROUND, GROUND, ROCK_IDS

from .conftest import walled


def test_boxes_are_closed_and_face_outwards():
    vertices, faces, normals = box_mesh(np.array([-1, -2, -3.0]), np.array([1, 2, 3.0]))
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    flux = np.cross(b - a, c - a) / 2
    np.testing.assert_allclose(flux.sum(axis=0), 0, atol=1e-12)
    assert (flux * a).sum() / 3 == 48  # divergence theorem: the volume, 2 x 4 x 6
    for corner in (0, 1, 2):
        np.testing.assert_allclose(np.cross(flux, normals[faces[:, corner]]), 0, atol=1e-12)


def test_walls_surround_the_sand_and_have_the_background_id(blocks, surfaces):
    mesh_faces = len(surfaces.faces)
    assert surfaces.id_of_face.tolist() == [GROUND] * 2 + [ROCK_IDS + 1] * 12
    around = build_surfaces(walled(blocks(), 1.5, 0.3), RenderOptions())
    assert (around.id_of_face[mesh_faces:] == BACKGROUND).all()
    added = around.vertices[len(surfaces.vertices) :]
    assert np.abs(added[:, :2]).max(axis=1).min() == 1.5
    assert added[:, 2].max() == 0.3


def test_hit_points_project_back_to_their_pixels(surfaces, camera, lens):
    hits = cast_strip(surfaces, Camera(camera, lens), slice(64, 128))
    assert len(hits.pixel) > 5000
    back = lens.project(camera.inverse().apply(hits.point.astype(float)))
    rows, columns = np.divmod(hits.pixel, lens.width)
    np.testing.assert_allclose(back, np.stack([columns + 0.5, rows + 64.5], axis=1), atol=1e-3)


def test_smooth_normals_are_blended_between_the_corners(lens, above):
    vertices = np.array([[-2, -2, 0], [2, -2, 0], [0, 2, 0]], float)
    tilted = np.array([[-0.6, 0, 0.8], [0.6, 0, 0.8], [0, 0.6, 0.8]])
    surfaces = Surfaces(vertices, np.array([[0, 1, 2]]), tilted, np.array([GROUND], np.int32))
    hits = cast_strip(surfaces, Camera(above, lens), slice(0, 64))
    matrix = np.concatenate([vertices[:, :2].T, np.ones((1, 3))])  # barycentric coordinates from scratch
    weights = np.linalg.solve(matrix, np.concatenate([hits.point[:, :2].T, np.ones((1, len(hits.pixel)))]))
    expected = weights.T @ tilted
    expected /= np.linalg.norm(expected, axis=1, keepdims=True)
    np.testing.assert_allclose(hits.normal, expected, atol=2e-5)
    np.testing.assert_allclose(hits.plane, np.tile([0, 0, 1], (len(hits.pixel), 1)), atol=1e-6)


def test_normals_face_the_viewer_inside_an_open_mesh(blocks, plain, lens, camera):
    mesh = blocks()
    inside_out = build_surfaces(type(mesh)(mesh.vertices, mesh.faces[:, ::-1], mesh.rock_of_face, -mesh.normals), plain)
    hits = cast_strip(inside_out, Camera(camera, lens), slice(0, lens.height))
    assert (np.einsum("nk,nk->n", hits.normal, hits.to_viewer) > 0).all()
    assert (np.einsum("nk,nk->n", hits.plane, hits.to_viewer) > 0).all()
