"""Scenes of several terrains: geometry and rock ids."""

import numpy as np
import pytest

from polarsim.errors import FormatError, RenderError
from polarsim.render.options import RenderOptions
from polarsim.render.views.options import SceneSection
from polarsim.render.views.scenes import Ensemble
from polarsim.run_files.instances import GROUND, ROCK_IDS

SIDE, HEIGHT = 0.4, 0.2  # metres, of the block
BARE = RenderOptions(rim=False, skirt_m=0)


def ensemble(folder, *points, options=BARE):
    terrains = [{"meshes": folder / "meshes", "terrain": 1, "offset_m": o, "heading_deg": h} for o, h in points]
    return Ensemble(SceneSection.model_validate({"name": "several", "terrains": terrains}), options)


def test_a_single_terrain_keeps_ids_and_position(folders):
    scene = ensemble(folders, ((0, 0, 0), 0))
    assert scene.rocks == {1: (0, 1)}
    np.testing.assert_array_equal(scene.surfaces.vertices, scene.parts[0].scene.surfaces.vertices)


def test_rocks_of_several_terrains_are_numbered_consecutively(folders):
    scene = ensemble(folders, ((0, 0, 0), 0), ((4, 0, 0), 90), ((8, 0, 0), 0))
    assert scene.rocks == {1: (0, 1), 2: (1, 1), 3: (2, 1)}
    surfaces = scene.surfaces
    for rock, (position, _) in scene.rocks.items():
        faces = surfaces.faces[surfaces.id_of_face == ROCK_IDS + rock]
        centre = surfaces.vertices[np.unique(faces)].mean(axis=0)
        np.testing.assert_allclose(centre, [4 * position, 0, HEIGHT / 2], atol=1e-9)
    assert set(np.unique(surfaces.id_of_face)) == {GROUND, ROCK_IDS + 1, ROCK_IDS + 2, ROCK_IDS + 3}


def test_heights_are_those_of_the_highest_surface(folders):
    scene = ensemble(folders, ((0, 0, 0), 0), ((4, 0, 0.5), 0))
    points = np.array([[0.0, 0], [1, 1], [4, 0], [5, 1], [50, 0]])
    np.testing.assert_allclose(scene.heights(points), [HEIGHT, 0, HEIGHT + 0.5, 0.5, -np.inf], atol=1e-6)


def test_a_rotated_terrain_has_its_normals_rotated(folders):
    plain, rotated = ensemble(folders, ((0, 0, 0), 0)), ensemble(folders, ((0, 0, 0), 30))
    c, s = np.cos(np.pi / 6), np.sin(np.pi / 6)
    rotation = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])
    np.testing.assert_allclose(rotated.surfaces.normals, plain.surfaces.normals @ rotation.T, atol=1e-12)
    corner = np.abs(rotated.surfaces.vertices[:, :2]).max(axis=0)
    np.testing.assert_allclose(corner, 2 * (c + s), atol=1e-6)
    assert corner.min() > SIDE


def test_more_rocks_than_ids_are_rejected(folders, monkeypatch):
    monkeypatch.setattr("polarsim.render.views.scenes.SHADOW_IDS", ROCK_IDS + 3)
    scene = ensemble(folders, *(((4 * position, 0, 0), 0) for position in range(3)))
    with pytest.raises(RenderError):
        _ = scene.surfaces


def test_missing_meshes_are_reported(tmp_path):
    with pytest.raises(FormatError, match=r"terrain01_ground\.obj"):
        ensemble(tmp_path, ((0, 0, 0), 0))
