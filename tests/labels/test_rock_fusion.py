"""Fusion of annotations of a position: two blocks on flat sand in photos from A and C."""

import numpy as np
import pytest

from polarsim.geometry.boxes import iou
from polarsim.geometry.outlines import TRIM
from polarsim.labels import fusion
from polarsim.labels.association import associate_rocks
from polarsim.labels.bodies import build_world
from polarsim.labels.fusion import PositionRocks
from polarsim.labels.options import LabelsOptions
from polarsim.labels.projection import project_rock
from polarsim.labels.seeds import AnnotatedBoxes
from polarsim.site import polar
from tests.support.polar_survey import RIG_LAMP, SUN_LAMPS

from .conftest import BLOCKS, localised, terrain_of

NEAR, FAR = BLOCKS
OPTIONS = LabelsOptions(visibility="annotator")


@pytest.fixture(autouse=True)
def annotated_boxes_alone(monkeypatch):
    """Set the weight of meshes to zero, so that expected boxes follow from the annotations."""
    monkeypatch.setattr("polarsim.labels.fusion.MESH_WEIGHT", 0.0)


def box_of(rock, position="A", camera="L", blocks=BLOCKS):
    world = build_world(terrain_of(blocks), TRIM, SUN_LAMPS, RIG_LAMP)
    return project_rock(world, localised(position).camera(camera), rock).box


def rocks_at(position, annotated, blocks=BLOCKS, options=OPTIONS):
    """Return the rocks of a position; `annotated`: position -> (camera, azimuth) -> boxes."""
    seeds = {
        name: {drawing: AnnotatedBoxes(np.array(boxes).reshape(-1, 4), None) for drawing, boxes in drawings.items()}
        for name, drawings in annotated.items()
    }
    rigs = {name: localised(name) for name in "AC"}
    return PositionRocks(associate_rocks(terrain_of(blocks), rigs, SUN_LAMPS, RIG_LAMP, seeds), position, options)


def test_an_annotation_under_the_same_lamp_has_double_weight():
    early, late = box_of(FAR), box_of(FAR) + np.array([0.0, 0.0, 12.0, 0.0])
    annotated = {"A": {("L", "30"): [early], ("L", "180"): [late]}}
    width = {}
    for azimuth in ("30", "180"):
        (label,) = rocks_at("A", annotated).labels("R", azimuth)
        width[azimuth] = label.box[2] - label.box[0]
    assert width["180"] - width["30"] == pytest.approx(12 / 3)  # a third of 12 px, and two thirds


def beyond_the_left_border():
    """Return the blocks and a block visible only in the right camera of A."""
    rig = localised("A")
    ray = rig.sandbox_from("R").rotate(rig.rig.right.directions(np.array([[1860.0, 650.0]])))[0]
    eye = rig.sandbox_from("R").translation
    return {**BLOCKS, 9: (eye - ray * eye[2] / ray[2], np.array([0.1, 0.1, 0.1]))}


def test_a_rock_outside_the_annotated_photos_is_projected_into_the_second_camera():
    blocks = beyond_the_left_border()
    annotated = {"A": {("L", azimuth): [box_of(NEAR), box_of(FAR)] for azimuth in polar().suns}}
    labels = {label.rock: label for label in rocks_at("A", annotated, blocks).labels("R", "30")}
    assert set(labels) == {NEAR, FAR, 9}
    assert labels[9].source == "projected"
    assert iou(labels[9].box[None], box_of(9, camera="R", blocks=blocks)[None])[0, 0] > 0.8


def test_an_unlit_rock_outside_the_annotated_photos_is_dropped(monkeypatch):
    blocks = beyond_the_left_border()
    annotated = {"A": {("L", azimuth): [box_of(NEAR), box_of(FAR)] for azimuth in polar().suns}}
    monkeypatch.setattr("polarsim.labels.fusion.lit_rock_share", lambda *_: 0.05)
    assert {label.rock for label in rocks_at("A", annotated, blocks).labels("R", "30")} == {NEAR, FAR}


def test_an_unannotated_rock_in_view_is_not_labelled():
    annotated = {"A": {("L", azimuth): [box_of(NEAR)] for azimuth in polar().suns}}
    assert {label.rock for label in rocks_at("A", annotated).labels("R", "30")} == {NEAR}


BEHIND, BARRIER = 1, 3
SHADED = {  # BARRIER is between BEHIND and lamp 180 at x = -3.5 m
    BEHIND: (np.array([0.6, -0.6, 0.0]), np.array([0.2, 0.2, 0.1])),
    BARRIER: (np.array([0.1, -0.6, 0.0]), np.array([0.2, 1.2, 0.8])),
}


def test_a_missing_annotation_of_a_dark_rock_is_no_evidence():
    both = [box_of(rock, blocks=SHADED) for rock in (BEHIND, BARRIER)]
    annotated = {"A": {("L", "180"): both[1:], ("L", "30"): both}}
    assert {label.rock for label in rocks_at("A", annotated, SHADED).labels("L", "350")} == {BEHIND, BARRIER}
    annotated = {"A": {("L", "270"): both[1:], ("L", "30"): both}}
    assert {label.rock for label in rocks_at("A", annotated, SHADED).labels("L", "350")} == {BARRIER}


@pytest.mark.parametrize(("elsewhere", "propagated"), [(False, False), (True, True), (None, True)])
def test_a_box_of_a_single_annotation_requires_a_second_position(elsewhere, propagated):
    """`elsewhere`: whether the rock is annotated at C; None: C has no annotations."""
    annotated = {"A": {("L", azimuth): [box_of(NEAR)] for azimuth in polar().suns}}
    annotated["A"]["L", "30"].append(box_of(FAR))
    if elsewhere is not None:
        annotated["C"] = {("L", "30"): [box_of(rock, "C") for rock in ((NEAR, FAR) if elsewhere else (NEAR,))]}
    shown = {label.rock for label in rocks_at("A", annotated).labels("R", "30")}
    assert shown == ({NEAR, FAR} if propagated else {NEAR})


def test_labels_without_a_sun_lamp_follow_the_annotator_model(monkeypatch):
    blocks = {
        1: (np.array([0.9, -0.5, 0.0]), np.array([0.1, 0.1, 0.05])),
        2: (np.array([-1.9, -0.5, 0.0]), np.array([0.05, 0.05, 0.03])),
        3: (np.array([-1.9, 0.6, 0.0]), np.array([0.3, 0.3, 0.2])),
    }
    annotated = {"A": {("L", azimuth): [box_of(rock, blocks=blocks) for rock in blocks] for azimuth in polar().suns}}
    labels = {label.rock: label.confidence for label in rocks_at("A", annotated, blocks).labels("L", "no")}
    assert set(labels) == {1, 3}
    assert labels[1] > labels[3] > fusion.MIN_PROBABILITY
    monkeypatch.setattr(fusion, "MIN_PROBABILITY", 0.0)
    assert {label.rock for label in rocks_at("A", annotated, blocks).labels("L", "no")} == set(blocks)
