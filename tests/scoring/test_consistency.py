"""Faults that runs have had, put back in: the run itself must notice, without any truth."""

import numpy as np
import pandas as pd
import pytest

from polarsim.formats.rigs import PlacedRig
from polarsim.formats.scene import TerrainMesh
from polarsim.geometry.poses import Pose
from polarsim.geometry.stereo import stated_rig
from polarsim.photo import NO_ROCK
from polarsim.scoring.complaints import complaints
from polarsim.scoring.consistency import boxes_met, cameras_together, scans_on_meshes
from polarsim.scoring.quality import quality_table
from polarsim.scoring.surface import Surface


@pytest.fixture
def scene():
    """Sand with bumps that tell shifts along it too."""
    axis = np.linspace(-1.8, 1.8, 121)
    x, y = (values.ravel() for values in np.meshgrid(axis, axis))
    vertices = np.column_stack([x, y, 0.04 * np.sin(5 * x) * np.cos(6 * y)])
    corner = (np.arange(120)[:, None] * 121 + np.arange(120)).ravel()
    faces = np.concatenate([corner[:, None] + [0, 1, 122], corner[:, None] + [0, 122, 121]])
    return TerrainMesh(vertices, faces, np.full(len(faces), NO_ROCK))


@pytest.fixture
def scans(scene, rng):
    """Two scans of the sand, 2 mm of noise."""
    surface, seen = Surface(scene.vertices, scene.faces), {}
    for position in "AC":
        points, face = surface.sample(20_000, rng)
        seen[position] = points + 0.002 * rng.normal(size=(len(points), 1)) * surface.normals[face]
    return seen


def said(figures):
    return complaints(quality_table("consistency", 3, figures))


def rotated(points, degrees, axis, shift_mm=(0, 0, 0)):
    turn = np.zeros(3)
    turn[axis] = np.radians(degrees)
    return Pose.from_rotvec(turn, np.array(shift_mm) / 1000).apply(points)


def test_a_sound_run_has_nothing_to_say(scans, scene):
    assert said(scans_on_meshes(scans, scene)) == []


def test_meshes_in_another_frame_than_the_scans_are_noticed(scans, scene):
    # An ICP after the cameras stage turned all surfaces by (0.185, 0.084, 0.007) degrees.
    turned = TerrainMesh(rotated(scene.vertices, 0.185, 0), scene.faces, scene.rock_of_face)
    (first, *_) = said(scans_on_meshes(scans, turned))
    assert first.startswith("Terrain 3: all scans on the meshes: all scans together would have to turn by 0.1")


def test_scans_that_were_aligned_behind_the_cameras_back_are_noticed(scans, scene):
    # Poses from A to C were written 2.1 mm and 0.035 degrees off; the meshes knew better.
    apart = {"A": rotated(scans["A"], 0.018, 2, (1, 0.3, 0)), "C": rotated(scans["C"], -0.018, 2, (-1, -0.3, 0))}
    assert any(
        "scans A and C" in sentence and "mm otherwise than written" in sentence
        for sentence in said(scans_on_meshes(apart, scene))
    )


def test_a_camera_that_only_the_survey_places_is_named(world):
    placed = {position: PlacedRig(stated_rig(), pose, "labels", {}) for position, pose in world.poses.items()}
    placed["C"] = PlacedRig(stated_rig(), world.poses["C"], "survey", {})
    (sentence,) = said(cameras_together(placed, placed))
    assert sentence.startswith("Terrain 3: camera C: nothing but the survey places the camera")


def test_cameras_that_photos_turned_away_from_the_meshes_are_noticed(world):
    before = {position: PlacedRig(stated_rig(), pose, "scans", {}) for position, pose in world.poses.items()}
    turn = Pose.from_rotvec(np.radians([0.15, 0.1, 0]), np.zeros(3))
    after = {
        position: PlacedRig(rig.rig, turn @ rig.sandbox_from_left, "scans, photos", {})
        for position, rig in before.items()
    }
    (sentence,) = said(cameras_together(before, after))
    assert "turned together by 0.180 degrees" in sentence


def test_meshes_that_miss_their_boxes_are_noticed():
    matches = pd.DataFrame({"position": list("AAC"), "iou": [0.8, 0.7, 0.4]})
    (sentence,) = said(boxes_met(matches))
    assert "position C" in sentence
    assert "0.40" in sentence
