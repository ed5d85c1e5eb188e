from dataclasses import replace

import numpy as np
import pytest

from polarsim.geometry.outlines import TRIM
from polarsim.labels.association import associate_rocks
from polarsim.labels.bodies import build_world
from polarsim.labels.options import LabelsOptions
from polarsim.labels.projection import project_rock
from polarsim.labels.propagate import PositionLabels
from polarsim.labels.seeds import AnnotatedBoxes
from polarsim.labels.visibility import is_dark, omitted_in_dark
from polarsim.photo import ROCK
from polarsim.run_files.walls import level_walls
from tests.support.polar_survey import RIG_LAMP, SUN_LAMPS

from .conftest import localised, terrain_of

OPEN, BEHIND, BARRIER = 1, 2, 3
ROCKS = {  # centre of the base, full extents: BARRIER is between BEHIND and lamp 180 at x = -3.5 m
    OPEN: ([0.6, 0.8, 0.0], [0.2, 0.2, 0.1]),
    BEHIND: ([0.6, -0.6, 0.0], [0.2, 0.2, 0.1]),
    BARRIER: ([0.1, -0.6, 0.0], [0.2, 1.2, 0.8]),
}
OPTIONS = LabelsOptions(visibility="annotator", ray_step_px=4)


@pytest.fixture(scope="module")
def terrain():
    return terrain_of(ROCKS)


@pytest.fixture(scope="module")
def world(terrain):
    return build_world(terrain, TRIM, SUN_LAMPS, RIG_LAMP)


def labelled(terrain, annotated_at, options, azimuth="180"):
    """Return the rocks labelled under a lamp, with boxes annotated under different lamps."""
    rig = localised("A")
    world = build_world(terrain, TRIM, SUN_LAMPS, RIG_LAMP)
    boxes = np.array([project_rock(world, rig.camera("L"), rock).box for rock in ROCKS])
    drawings = {("L", other): AnnotatedBoxes(boxes, None) for other in annotated_at}
    seeds = {"A": drawings} if drawings else {}
    known = associate_rocks(terrain, {"A": rig}, SUN_LAMPS, RIG_LAMP, seeds)
    labels = PositionLabels(known, "A", options).labels("L", "off", azimuth)
    return {label.rock for label in labels if label.kind == ROCK}


def test_a_rock_behind_a_high_rock_is_dark_under_the_opposite_lamp_only(world):
    assert is_dark(world, BEHIND, "180")
    assert not any(is_dark(world, BEHIND, azimuth) for azimuth in ("30", "270", "350"))


def test_no_rock_occludes_itself_completely(world):
    assert not any(is_dark(world, rock, azimuth) for rock in (OPEN, BARRIER) for azimuth in SUN_LAMPS)


@pytest.mark.parametrize(("above", "dark"), [(-0.1, True), (0.1, False)])
def test_a_rock_lit_from_any_possible_lamp_position_is_not_dark(world, above, dark):
    """Expected: the ray over the far edge of the barrier (0.2, 0.8 m high) to the top of the rock (0.7, 0.1 m high)."""
    x, y, _ = SUN_LAMPS["180"]
    nearest = x + 0.6  # two standard deviations of the survey towards the barrier
    grazing = 0.8 + (0.8 - 0.1) / (0.7 - 0.2) * (0.2 - nearest)
    raised = replace(world, suns={"180": np.array([x, y, grazing + above])})
    assert is_dark(raised, BEHIND, "180") == dark


def test_walls_shade_the_ground_next_to_them(terrain):
    walled = build_world(replace(terrain, walls=level_walls(2.0, 2.0)), TRIM, SUN_LAMPS, RIG_LAMP)
    assert is_dark(walled, OPEN, "30")


def test_rocks_without_a_body_or_lamp_are_not_dark(world):
    assert not is_dark(world, BEHIND, "no")
    assert not is_dark(world, 77, "180")


def test_an_annotated_rock_in_computed_darkness_is_not_omitted(world):
    assert omitted_in_dark(world, BEHIND, "180", ["30", "350"])
    assert not omitted_in_dark(world, BEHIND, "180", ["30", "180"])


def test_annotators_omit_dark_rocks(terrain):
    assert labelled(terrain, ["30"], OPTIONS) == {OPEN, BARRIER}
    assert labelled(terrain, [], OPTIONS) == {OPEN, BARRIER}  # projected meshes
    assert labelled(terrain, ["30"], OPTIONS, azimuth="350") == set(ROCKS)


def test_dark_rocks_are_labelled_in_the_second_camera_if_annotated(terrain):
    assert labelled(terrain, ["180"], OPTIONS) == set(ROCKS)
    assert labelled(terrain, ["30"], OPTIONS.model_copy(update={"visibility": "photo"})) == set(ROCKS)
