"""Small synthetic terrains, seen from three positions by two cameras, with one wrong file."""

import numpy as np
import pytest

from polarsim.lint.rules import RULES
from polarsim.lint.siblings import sibling_defects
from polarsim.lint.views import view_defects
from polarsim.photo import PhotoKey
from polarsim.site import polar
from tests.lint.test_boxes import ROCK, SHADOW
from tests.support.polar_rig import default_rig
from tests.support.polar_survey import lamp_position, surveyed_pose

PLACES = np.array(
    [(-0.9, -0.6), (-0.3, 0.7), (0.2, -0.2), (0.7, 0.5), (0.9, -0.7), (-0.6, 0.1), (0.1, 0.2), (-0.1, -0.8)]
)
SIDE = 0.16  # metres


def annotated(key, points, offset=0.0):
    """Return boxes of objects of 16 cm on the ground, moved by `offset` metres away from the lamp."""
    left = surveyed_pose(key.position)
    rig = default_rig()
    pose = left if key.camera == "L" else left @ rig.left_from_right
    away = points - lamp_position(key.azimuth)[:2]
    feet = points + offset * away / np.linalg.norm(away, axis=1, keepdims=True)
    found = []
    for x, y in feet:
        corners = np.array(
            [(x + i, y + j, z) for i in (-SIDE / 2, SIDE / 2) for j in (-SIDE / 2, SIDE / 2) for z in (0, 0.08)]
        )
        pixels = rig.lens(key.camera).project(pose.inverse().apply(corners))
        found.append([*pixels.min(axis=0), *pixels.max(axis=0)])
    return np.round(found)


def labels(key, rng):
    rocks, shadows = annotated(key, PLACES), annotated(key, PLACES, 0.18)
    rocks += rng.integers(-2, 3, rocks.shape)  # each azimuth was annotated separately
    return np.array([ROCK] * len(rocks) + [SHADOW] * len(shadows)), np.concatenate([rocks, shadows])


@pytest.fixture
def files():
    """Return one file per exposure bracket; the rover light changes no label."""
    found = {}
    for position in "AB":
        for camera in "LR":
            for azimuth in polar().suns:
                off = PhotoKey(3, position, "off", azimuth, camera, 256)
                seed = [ord(position), ord(camera), int(azimuth)]
                found[off] = labels(off, np.random.default_rng(seed))
                found[PhotoKey(3, position, "on", azimuth, camera, 256)] = found[off]
    return found


def names(files):
    return {
        (str(key), defect.name) for key, defect in (*sibling_defects(files, polar()), *view_defects(files, polar()))
    }


KEY = PhotoKey.parse("03_A_off_180_L_0256")
LIT = PhotoKey.parse("03_A_on_180_L_0256")


def test_a_sound_terrain_has_no_defect(files):
    assert names(files) == set()


def changed(files, key, classes, boxes):
    return files | {key: (np.asarray(classes), np.asarray(boxes, float))}


def test_the_content_of_another_azimuth_is_found(files):
    found = names(files | {KEY: files[PhotoKey.parse("03_A_off_30_L_0256")]})
    assert (str(KEY), "copied_azimuth") in found


def test_shadows_of_another_azimuth_are_found(files):
    classes, boxes = files[KEY]
    other = files[PhotoKey.parse("03_A_off_270_L_0256")][1]
    found = names(changed(files, KEY, classes, np.concatenate([boxes[:8], other[8:]])))
    assert (str(KEY), "other_azimuth") in found


def test_the_boxes_of_another_view_are_found(files):
    for other in ("03_B_off_180_L_0256", "03_A_off_180_R_0256"):
        assert (str(KEY), "other_view") in names(files | {KEY: files[PhotoKey.parse(other)]})


def test_rocks_that_differ_between_azimuths_are_reported(files):
    classes, boxes = files[KEY]
    assert (str(KEY), "rock_absent") in names(changed(files, KEY, classes[1:], boxes[1:]))
    more = np.concatenate([boxes, [[20, 900, 90, 950]]])
    assert (str(KEY), "rock_alone") in names(changed(files, KEY, [*classes, ROCK], more))


def test_a_rock_annotated_as_a_shadow_is_reported_with_its_row(files):
    classes, boxes = files[KEY]
    swapped = np.array([SHADOW, *classes[1:]])
    found = [
        one for key, one in sibling_defects(changed(files, KEY, swapped, boxes), polar()) if one.name == "swapped_class"
    ]
    assert [one.rows for one in found] == [(0,)]


def test_other_labels_with_the_rover_light_on_are_found(files):
    classes, boxes = files[LIT]
    assert (str(LIT), "light_rocks_differ") in names(changed(files, LIT, classes[1:], boxes[1:]))
    assert (str(LIT), "light_shadows_differ") in names(changed(files, LIT, classes[:-1], boxes[:-1]))
    moved = boxes + np.where(np.arange(16)[:, None] == 0, [8, 0, 8, 0], 0)
    assert (str(LIT), "light_rock_moved") in names(changed(files, LIT, classes, moved))
    moved = boxes + np.where(np.arange(16)[:, None] == 15, [12, 0, 12, 0], 0)
    assert (str(LIT), "light_shadow_moved") in names(changed(files, LIT, classes, moved))


def test_epipolar_violations_are_reported(files):
    key = PhotoKey.parse("03_A_off_180_R_0256")
    classes, boxes = files[key]
    height = boxes[2, 3] - boxes[2, 1]
    moved = boxes + np.where(np.arange(16)[:, None] == 2, [0, 1.5 * height, 0, 1.5 * height], 0)
    assert (str(key), "off_epipolar") in names(changed(files, key, classes, moved))


def test_epipolar_violations_are_found_in_larger_photos(files):
    site = polar()
    images = site.images.model_copy(update={"width": 3 * 968, "height": 3 * 608})
    cameras = site.cameras.model_copy(update={"calibration": None})
    site = site.model_copy(update={"images": images, "cameras": cameras})
    large = {key: (classes, 1.5 * boxes) for key, (classes, boxes) in files.items()}
    assert not [defect for _, defect in view_defects(large, site) if defect.name == "off_epipolar"]
    key = PhotoKey.parse("03_A_off_180_R_0256")
    classes, boxes = large[key]
    drop = 1.5 * (boxes[2, 3] - boxes[2, 1])
    large[key] = classes, boxes + np.where(np.arange(16)[:, None] == 2, [0, drop, 0, drop], 0)
    assert [name for name, defect in view_defects(large, site) if defect.name == "off_epipolar"] == [key]


def test_a_shadow_on_the_suns_side_is_found_with_its_row(files):
    classes, boxes = files[KEY]
    boxes = boxes.copy()
    boxes[8] = annotated(KEY, PLACES[:1], -0.18)[0]
    found = [
        one for key, one in view_defects(changed(files, KEY, classes, boxes), polar()) if one.name == "sunward_shadow"
    ]
    assert [one.rows for one in found] == [(8,)]


def test_missing_right_labels_without_sun_are_reported(files):
    lone, pair = (PhotoKey(3, "A", "on", "no", "L", exposure) for exposure in (1024, 2048))
    dark = {lone: files[KEY], pair: files[KEY], PhotoKey(3, "A", "on", "no", "R", 2048): files[KEY]}
    assert {one for one in names(files | dark) if one[1] == "missing_right"} == {(str(lone), "missing_right")}


def test_every_rule_has_a_unique_code():
    assert len({rule.code for rule in RULES.values()}) == len(RULES)
