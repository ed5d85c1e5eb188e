from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pydantic import ValidationError

from polarsim.formats.scene import TerrainMesh
from polarsim.labels.known import gather
from polarsim.labels.lamps import SURVEY_SD, FarEdges, fit_lamp, with_refined_lamps
from polarsim.labels.options import LabelsOptions
from polarsim.labels.position_rocks import PositionRocks
from polarsim.labels.position_shadows import PositionShadows
from polarsim.labels.seeds import Drawn
from polarsim.labels.shadows import thrown
from polarsim.labels.view import View, project_rock
from polarsim.photo import NO_ROCK
from polarsim.survey import SUN_LAMPS

from .conftest import block, flat_ground, placed

OPTIONS = LabelsOptions(refine_lamps=True, wall_height_m=0, ray_step_px=4)
ROCKS = {  # rock id -> centre of the base, and full extents, metres; shadows end on the ground
    1: ([0.9, 0.9, 0], [0.16, 0.20, 0.08]),
    2: ([0.9, -0.8, 0], [0.20, 0.16, 0.10]),
    3: ([-0.5, 0.0, 0], [0.18, 0.18, 0.07]),
    4: ([-0.2, 1.3, 0], [0.14, 0.20, 0.09]),
    5: ([-0.9, -1.0, 0], [0.20, 0.20, 0.08]),
}
TRUE = {  # off the survey by 0.3 m, mostly across the line to the middle: along it shadows hardly move
    "30": SUN_LAMPS["30"] + [-0.10, 0.25, 0.12],
    "180": SUN_LAMPS["180"] + [0.05, -0.25, -0.12],
    "270": SUN_LAMPS["270"] + [0.25, 0.05, 0.12],
    "350": SUN_LAMPS["350"] + [0.06, 0.26, -0.12],
}
PEN_PX = 3.0  # standard deviation of a drawn edge


@pytest.fixture(scope="module")
def terrain():
    parts = [(NO_ROCK, flat_ground()), *((rock, block(*map(np.array, shape))) for rock, shape in ROCKS.items())]
    starts = np.cumsum([0, *(len(mesh.vertices) for _, mesh in parts)])
    return TerrainMesh(
        np.concatenate([mesh.vertices for _, mesh in parts]),
        np.concatenate([mesh.faces + start for (_, mesh), start in zip(parts, starts, strict=False)]),
        np.concatenate([np.full(len(mesh.faces), rock) for rock, mesh in parts]),
    )


@pytest.fixture(scope="module")
def drawn(terrain):
    """Seeds of two positions, as people draw under the true lamps."""
    rng = np.random.default_rng(5)
    rigs = {position: placed(position) for position in "AC"}
    known = gather(terrain, rigs, TRUE, {}, OPTIONS)
    seeds = {}
    for position, rig in rigs.items():
        shown = {rock: project_rock(known.world, View(rig, "L"), rock).box for rock in ROCKS}
        shadows = PositionShadows(PositionRocks(known, position, OPTIONS), OPTIONS)
        for azimuth in TRUE:
            cast = np.array([shadow.box for shadow in shadows.cast("L", "off", azimuth, shown).values()])
            drawn = Drawn(np.array(list(shown.values())), cast + rng.normal(0, PEN_PX, cast.shape))
            seeds.setdefault(position, {})["L", azimuth] = drawn
    return seeds


@pytest.fixture(scope="module")
def surveyed(terrain, drawn):
    return gather(terrain, {position: placed(position) for position in "AC"}, SUN_LAMPS, drawn, OPTIONS)


@pytest.fixture(scope="module")
def refined(surveyed):
    return with_refined_lamps(surveyed, set(SUN_LAMPS), OPTIONS.model_copy(update={"min_lamp_shadows": 4}))


def off(suns, azimuth):
    return np.linalg.norm(suns[azimuth] - TRUE[azimuth])


@pytest.mark.parametrize("azimuth", sorted(TRUE))
def test_a_lamp_that_stood_decimetres_off_its_survey_is_found_by_its_shadows(refined, azimuth):
    assert off(SUN_LAMPS, azimuth) > 0.25
    assert off(refined.world.suns, azimuth) < 0.5 * off(SUN_LAMPS, azimuth)


def without_shadows(known):
    seeds = {
        position: {sight: replace(drawn, shadows=None) for sight, drawn in drawings.items()}
        for position, drawings in known.seeds.items()
    }
    return replace(known, seeds=seeds)


def test_without_a_drawn_shadow_lamps_stay_in_the_survey(surveyed):
    for known in (without_shadows(surveyed), replace(surveyed, seeds={})):
        suns = with_refined_lamps(known, set(SUN_LAMPS), OPTIONS).world.suns
        assert sorted(suns) == sorted(SUN_LAMPS)
        for azimuth, place in SUN_LAMPS.items():
            np.testing.assert_array_equal(suns[azimuth], place)


def test_too_few_shadows_move_no_lamp(surveyed):
    suns = with_refined_lamps(surveyed, set(SUN_LAMPS), OPTIONS.model_copy(update={"min_lamp_shadows": 11})).world.suns
    np.testing.assert_array_equal([suns[azimuth] for azimuth in SUN_LAMPS], list(SUN_LAMPS.values()))


def test_a_lamp_that_photos_place_is_left_there(surveyed):
    suns = with_refined_lamps(surveyed, {"30", "270"}, OPTIONS.model_copy(update={"min_lamp_shadows": 4})).world.suns
    np.testing.assert_array_equal(suns["180"], SUN_LAMPS["180"])
    assert off(suns, "30") < off(SUN_LAMPS, "30")


def test_seeds_of_a_position_without_a_pose_tell_nothing(surveyed):
    known = replace(surveyed, seeds={"B": surveyed.seeds["A"]})
    suns = with_refined_lamps(known, set(SUN_LAMPS), OPTIONS).world.suns
    np.testing.assert_array_equal(suns["30"], SUN_LAMPS["30"])


START = SUN_LAMPS["30"]
BEHIND = np.array([[-1.0, 0], [0, -1], [1, 0], [0, 1]])


def edges(rng, count, lamp_place, noise_px=0.0):
    """Ends of shadows of points above level sand, drawn under a lamp and cast from the surveyed one."""
    blockers = np.column_stack([rng.uniform(-1, 1, (count, 2)), rng.uniform(0.05, 0.2, count)])[:, None]
    outward = BEHIND[rng.integers(0, 4, count)]
    cast = FarEdges(View(placed("A"), "L"), START, count, np.zeros(count), outward, blockers, np.zeros((count, 1)))
    return replace(cast, off=-cast.off_at(lamp_place) + rng.normal(0, noise_px, count))


@settings(deadline=None, max_examples=25)
@given(move=st.tuples(*[st.floats(-0.3, 0.3)] * 2, st.floats(-0.15, 0.15)).map(np.array), seed=st.integers(0, 99))
def test_many_edges_outweigh_the_survey(move, seed):
    drawn = edges(np.random.default_rng(seed), 300, START + move, noise_px=2)
    found = fit_lamp(START, [drawn])
    assert np.linalg.norm(np.cross(found, START + move)) / np.linalg.norm(START) < 0.06  # across the line to the middle


def test_edges_drawn_somewhere_else_count_little(rng):
    true = START + np.array([0.05, -0.2, 0.05])
    wrong = replace(edges(rng, 12, START), off=np.full(12, 150.0))
    found = fit_lamp(START, [edges(rng, 100, true, noise_px=2), wrong])
    assert np.linalg.norm(found - true) < 0.5 * np.linalg.norm(START - true)


def test_one_edge_hardly_moves_a_lamp_along_its_light(rng):
    found = fit_lamp(START, [edges(rng, 1, START + np.array([0.3, 0.1, 0.0]))])
    assert np.linalg.norm(found - START) < 0.15


def test_the_shadow_of_a_point_lies_on_the_line_from_the_lamp():
    # A lamp 1 m high, a point 0.2 m high 2 m away: the shadow ends 0.5 m beyond it.
    np.testing.assert_allclose(thrown(np.array([2.0, 0, 0.2]), np.array(0.0), np.array([0.0, 0, 1])), [2.5, 0, 0])


def test_no_lamp_is_looked_for_far_off_its_survey(rng):
    absurd = replace(edges(rng, 40, START), off=np.full(40, 400.0))
    assert (np.abs(fit_lamp(START, [absurd]) - START) <= 2 * SURVEY_SD + 1e-9).all()


def test_no_edge_is_no_move():
    np.testing.assert_array_equal(fit_lamp(START, []), START)


def test_no_lamp_can_be_refined_without_a_shadow():
    with pytest.raises(ValidationError, match="min_lamp_shadows"):
        LabelsOptions(min_lamp_shadows=0)
