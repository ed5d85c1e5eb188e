import json

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from polarsim.errors import FormatError
from polarsim.formats import yolo
from polarsim.labels.annotator import (
    EDGE_TERMS,
    NO_HABITS,
    OUTWARD,
    PACKAGED,
    ROVER_LIGHT_TERMS,
    Annotator,
    edge_terms,
    read_annotator,
    rover_light_terms,
)
from polarsim.labels.fit_annotator import (
    AnnotatorSamples,
    TerrainFiles,
    fit_annotator,
    rover_light_samples,
    shadow_edge_samples,
    write_annotator,
)
from polarsim.labels.options import LabelsOptions
from polarsim.labels.propagate import labels_of_terrain
from polarsim.labels.seeds import AnnotatedBoxes
from polarsim.photo import PhotoKey
from polarsim.site import polar
from tests.support.polar_photos import SIZE

from .conftest import BLOCKS, TERRAIN

WIDTH = 1936
ROCK, SHADOW = np.array([500.0, 400, 560, 450]), np.array([550.0, 420, 680, 448])
corner = st.floats(100, 1500)
side = st.floats(12, 300)
draw = read_annotator().draw_shadow


@st.composite
def box(draw):
    x, y = draw(corner), draw(corner)
    return np.array([x, y, x + draw(side), y + draw(side)])


def mirrored(box):
    return np.array([WIDTH - box[2], box[1], WIDTH - box[0], box[3]])


@given(box(), box(), st.floats(200, 1200))
def test_left_and_right_have_equal_habits(shadow, rock, px_per_m):
    found = draw(shadow, rock, rock, px_per_m)
    np.testing.assert_allclose(
        draw(mirrored(shadow), mirrored(rock), mirrored(rock), px_per_m), mirrored(found), atol=1e-9
    )


def test_annotators_start_a_shadow_away_from_the_rock_centre():
    # Facts on the labels, 2.6: for a lamp at the side, the near edge is at 0.75 to 0.93 of the width of the rock.
    shadow = np.array([530.0, 420, 680, 448])
    found = draw(shadow, ROCK, ROCK, 600)
    assert 0.5 < (found[0] - ROCK[0]) / 60 < 0.93
    assert found[2] < shadow[2] + 30


def test_without_habits_a_cast_shadow_stays_as_it_is():
    np.testing.assert_array_equal(NO_HABITS.draw_shadow(SHADOW, ROCK, ROCK, 600), SHADOW)


def test_a_probability_is_the_logistic_function_of_the_terms():
    terms = rover_light_terms(0.5, 1.0, 25.0, 4.5)
    assert terms == pytest.approx([1, -0.5, 0, np.log(0.5), 1.0])  # half the azimuths, half of 50 px, 1 m beyond 3.5 m
    annotator = Annotator(NO_HABITS.edges, (1.0, 2, 3, 4, 5))
    assert annotator.rock_probability(terms) == pytest.approx(1 / (1 + np.exp(-(1 - 1 + 4 * np.log(0.5) + 5))))


def test_distant_small_and_rarely_annotated_rocks_are_less_probable():
    def probability(*terms):
        return read_annotator().rock_probability(rover_light_terms(*terms))

    usual = probability(1.0, 1.0, 40.0, 3.0)
    for other in ((1.0, 1.0, 40.0, 6.0), (1.0, 1.0, 20.0, 3.0), (0.5, 1.0, 40.0, 3.0)):
        assert probability(*other) < usual
    assert probability(1.0, 1.0, 400.0, 3.0) == probability(1.0, 1.0, 60.0, 3.0)


@settings(max_examples=6, deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_a_fit_recovers_the_habits_of_simulated_annotators(seed):
    random = np.random.default_rng(seed)
    edges, rover = random.uniform(-0.3, 0.3, len(EDGE_TERMS)), np.array([1.0, 1.5, 0.5, 1.0, -0.5])
    terms = np.concatenate(
        [edge_terms(SHADOW + random.normal(0, 20, 4), ROCK, ROCK + random.normal(0, 5, 4), 600) for _ in range(60)]
    )
    moves = terms @ edges + random.normal(0, 0.01, len(terms))
    moves[::20] += 80  # outliers
    lit = random.normal(0, 1, (4000, len(ROVER_LIGHT_TERMS)))
    found = fit_annotator([AnnotatorSamples(terms, moves)], [AnnotatorSamples(lit, 1 / (1 + np.exp(-lit @ rover)))])
    np.testing.assert_allclose(terms @ np.array(found.edges), terms @ edges, atol=0.5)
    np.testing.assert_allclose(found.rover_light, rover, atol=0.05)


def test_a_run_gives_samples_of_both_habits(scene):
    files = TerrainFiles(polar(), TERRAIN, scene.seeds, scene.cameras, scene.meshes)
    options = LabelsOptions(ray_step_px=4, visibility="annotator")
    key = PhotoKey.parse("03_A_off_180_L_0256")
    rocks = np.array([scene.expected_box("A", "L", rock) for rock in BLOCKS])
    inputs = scene.inputs([key], NO_HABITS)
    (scene.seeds / f"{key}.txt").unlink()
    cast = [label.box for label in labels_of_terrain(inputs, options)[key] if label.kind == "shadow"]
    yolo.write_boxes(
        scene.seeds / f"{key}.txt", np.array([0] * 2 + [1] * len(cast)), np.array([*rocks, *cast]) + 0.0, size=SIZE
    )
    samples = shadow_edge_samples(files, options)
    assert samples.terms.shape == (4 * 2 * len(cast), len(EDGE_TERMS))  # and as many under lamp 30
    assert np.sort(np.abs(samples.observed))[: 4 * len(cast)].max() < 1  # annotated where cast, but for rounding
    rover = PhotoKey.parse("03_A_on_no_L_4096")
    lit = rover_light_samples(
        files, {key: AnnotatedBoxes(rocks, None), rover: AnnotatedBoxes(rocks[:1], None)}, options
    )
    assert lit.terms.shape == (2, len(ROVER_LIGHT_TERMS))
    assert sorted(lit.observed) == [0, 1]


def test_a_fit_is_read_as_it_was_written(tmp_path):
    annotator = read_annotator()
    write_annotator(tmp_path / "own.json", annotator, "a test")
    assert read_annotator(tmp_path / "own.json") == annotator
    assert len(OUTWARD) == 4


def test_a_file_without_a_coefficient_is_refused(tmp_path):
    content = json.loads(PACKAGED.read_text())
    del content["shadow_edges"]["coefficients"]["far m"]
    (tmp_path / "short.json").write_text(json.dumps(content))
    with pytest.raises(FormatError) as error:
        read_annotator(tmp_path / "short.json")
    assert error.value.path == tmp_path / "short.json"
