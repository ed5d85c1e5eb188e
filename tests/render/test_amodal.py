"""Amodal masks compared with id maps of each single rock on the ground."""

import numpy as np
import pytest

from polarsim.geometry.camera import Camera
from polarsim.geometry.poses import camera_pose
from polarsim.photo import NO_ROCK
from polarsim.render.ground_truth import amodal_masks, annotate_ids, occluded_pixels
from polarsim.render.olat import NO_LAMP
from polarsim.render.options import RenderOptions
from polarsim.render.surfaces import build_surfaces
from polarsim.run_files.scene import TerrainMesh

from .conftest import PLAIN, SMALL, block, walled

ROCKS, PLACES = (4, 7, 9, 12), ((1.1, 0.1), (0.55, 0.2), (0.45, 0.45), (-0.6, -0.8))
LOW = camera_pose(np.array([2.4, 0.2, 0.45]), np.pi, np.radians(8))  # rocks hide each other
WALLED = RenderOptions(bounce=0)


def alone(mesh, rock):
    """Return the terrain without all other rocks."""
    stays = (mesh.rock_of_face == NO_ROCK) | (mesh.rock_of_face == rock)
    return TerrainMesh(mesh.vertices, mesh.faces[stays], mesh.rock_of_face[stays], mesh.normals)


def whole_by_brute_force(mesh, rock, pose, ids_of):
    """Return the mask (h, w) of a rock in an image of only rock and ground."""
    return ids_of(build_surfaces(alone(mesh, rock), PLAIN), pose, SMALL, {})[NO_LAMP] == 1000 + rock


def whole(surfaces, pose, ids_of):
    """Return the masks by rock from `occluded_pixels`."""
    ids = ids_of(surfaces, pose, SMALL, {})[NO_LAMP]
    found = {}
    for rock, behind in occluded_pixels(surfaces, Camera(pose, SMALL), ids).items():
        found[rock] = ids == 1000 + rock
        assert not found[rock].flat[behind].any()
        found[rock].flat[behind] = True
    return found


def assert_equal_but_where_rocks_meet(mask, expected):
    """Allow a small share of differences: a ray that hits two rocks within `START_OFFSET` reports only the first."""
    assert (mask != expected).sum() <= 1e-4 * mask.size


@pytest.mark.parametrize("lifts", [(0, 0, 0, 0), (-0.1, 0.06, -0.07, 0.02)], ids=["level", "buried and floating"])
@pytest.mark.parametrize("options", [PLAIN, WALLED], ids=["open", "walled"])
@pytest.mark.parametrize("pose", [LOW, camera_pose(np.array([0.9, 1.9, 0.6]), -2.0, 0.4)], ids=["low", "close"])
def test_amodal_masks_equal_renderings_of_single_rocks(ids_of, pose, options, lifts):
    mesh = walled(block(ROCKS, PLACES), 1.4, 0.15)
    for rock, lift in zip(ROCKS, lifts, strict=True):
        mesh.vertices[np.unique(mesh.faces[mesh.rock_of_face == rock]), 2] += lift
    surfaces = build_surfaces(mesh, options)
    found = whole(surfaces, pose, ids_of)
    ids = ids_of(surfaces, pose, SMALL, {})[NO_LAMP]
    assert any((ids == 1000 + rock).sum() < 0.9 * mask.sum() for rock, mask in found.items())
    for rock, mask in found.items():
        assert_equal_but_where_rocks_meet(mask, whole_by_brute_force(mesh, rock, pose, ids_of))


def test_annotations_contain_the_visible_share(ids_of):
    surfaces = build_surfaces(block(ROCKS, PLACES), PLAIN)
    ids = ids_of(surfaces, LOW, SMALL, {})[NO_LAMP]
    hidden = occluded_pixels(surfaces, Camera(LOW, SMALL), ids)
    labels = {label.rock: label for label in annotate_ids(ids, PLAIN, amodal_masks(ids, hidden, PLAIN))}
    expected = whole(surfaces, LOW, ids_of)
    assert labels[4].visible_share == 1
    assert labels[4].amodal.mask == labels[4].mask
    assert 0 < labels[7].visible_share < 0.9
    for rock, label in labels.items():
        shown, all_of_it = label.mask.mask(), label.amodal.mask.mask()
        assert (all_of_it | ~shown).all()
        assert (all_of_it & expected[rock]).sum() >= 0.98 * expected[rock].sum()  # small components are excluded
        assert label.visible_share == shown.sum() / all_of_it.sum()
        rows, columns = np.nonzero(all_of_it)
        np.testing.assert_array_equal(label.amodal.box, [columns.min(), rows.min(), columns.max() + 1, rows.max() + 1])


def test_partly_hidden_rocks_have_rock_and_shadow_labels(ids_of):
    from polarsim.render.lamps import Lamp

    surfaces = build_surfaces(block(ROCKS, PLACES), PLAIN)
    pictures = ids_of(surfaces, LOW, SMALL, {"sun": Lamp(np.array([0.5, 3.0, 1.0]))})
    occluded = amodal_masks(pictures[NO_LAMP], occluded_pixels(surfaces, Camera(LOW, SMALL), pictures[NO_LAMP]), PLAIN)
    every = annotate_ids(pictures["sun"], PLAIN, occluded)
    assert min(label.visible_share for label in every) < 0.9
    assert {label.kind for label in every} == {"rock", "shadow"}
