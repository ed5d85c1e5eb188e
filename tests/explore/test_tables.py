import json

import numpy as np
import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from polarsim.detect.evaluate import clip_labels
from polarsim.detect.false_positives import false_positives
from polarsim.explore.pictures import outlines_of_twins
from polarsim.explore.site import overview
from polarsim.explore.tables import facts_of_rocks, picture_table, shown_predictions
from polarsim.explore.terrain import clustered, terrain_setup, thinned_terrain
from polarsim.geometry.polygons import signed_area
from polarsim.photo import BOX_CLASSES
from polarsim.run_files.run import Run
from polarsim.schemas.detect import PREDICTIONS
from tests.made_terrain import make_sand
from tests.support.polar_photos import HEIGHT, SIZE, WIDTH

from .made_run import KEYS, MODELS, RIG, SEED, boxes_of


def test_every_image_has_a_row_with_score_and_counts(made):
    table = picture_table(Run.at(made)).set_index(["key", "domain"])
    assert len(table) == len(KEYS) * 3
    photo, twin = table.loc[(str(SEED), "photo")], table.loc[(str(SEED), "hapke")]
    assert (photo["score"], twin["score"]) == (0.9, 0.5)
    assert (photo["rocks"], photo["shadows"]) == (2, 2)
    assert photo["confidence"] == pytest.approx((0.99 + 0.4) / 2)
    assert photo["min_confidence"] == 0.4
    assert table["defect"].value_counts().to_dict() == {"": len(table) - 1, "dark": 1}
    assert table.loc[(str(KEYS[0]), "photo"), "defect"] == "dark"


def test_the_overview_is_json_and_lists_the_available_data(made):
    told = json.loads(json.dumps(overview(Run.at(made))))
    assert told["domains"] == ["photo", *MODELS]
    assert told["predictions"] == ["photo/seed0/analog_on_analog"]
    assert (told["drives"], told["seeds"], told["undone"]) == (["seed0"], [str(SEED)], [str(SEED)])


def test_predictions_are_matched_once_and_false_positives_without_label(made):
    seen = shown_predictions(Run.at(made), "photo/seed0/analog_on_analog")
    first = seen[seen["key"] == str(KEYS[0])]
    assert first["confidence"].tolist() == [0.9, 0.8, 0.6]  # the prediction of low confidence is excluded
    assert first["right"].tolist() == [True, False, False]  # a rock is matched once
    assert first["false_positive"].tolist() == [False, True, False]
    assert first["rock"].tolist() == [1, -1, 1]


@st.composite
def predictions(draw):
    """Strategy for boxes of both classes: anywhere, small parts of labels, and around labels."""
    rows = []
    for key in draw(st.lists(st.sampled_from(KEYS), min_size=1, max_size=4, unique=True)):
        anchors = [np.zeros(4), *boxes_of(key).values()]
        for _ in range(draw(st.integers(1, 12))):
            x, y, w, h = anchors[draw(st.integers(0, len(anchors) - 1))] * [1, 1, 0, 0] + [
                draw(st.integers(-200, 1700)), draw(st.integers(-200, 1000)),
                draw(st.integers(2, 200)), draw(st.integers(2, 200)),
            ]  # fmt: skip
            box = np.clip([x, y, x + w, y + h], 0, [WIDTH, HEIGHT, WIDTH, HEIGHT])
            if (box[2:] > box[:2]).all():
                sure = draw(st.sampled_from([0.1, 0.25, 0.6, 0.9]))
                rows.append((str(key), draw(st.sampled_from(BOX_CLASSES)), sure, *box))
    return rows


@settings(max_examples=8)
@given(rows=predictions())
def test_the_explorer_counts_the_false_positives_of_the_table(made, rows):
    x0, y0, _, _ = boxes_of(SEED)["rock", 1]
    rows.append((str(SEED), "rock", 0.8, x0 + 1, y0 + 1, x0 + 5, y0 + 5))  # IoU below 0.1, and on the label
    rows.append((str(SEED), "shadow", 0.8, 5, 5, 60, 60))
    found = pd.DataFrame(rows, columns=list(PREDICTIONS.columns))
    run = _Predicted(made)
    run.predictions, run.found = {"photo/seed0/a_on_analog": made}, found
    shown = shown_predictions(run, "photo/seed0/a_on_analog")
    sure = shown[shown["confidence"] >= 0.25]
    labels = clip_labels(run.labels(3), SIZE)
    table = false_positives([str(key) for key in KEYS], labels, found, size=SIZE, confidence=0.25, resamples=2)
    assert sure["false_positive"].sum() == table["false_positives"].sum()
    assert not shown.loc[shown["kind"] == "shadow", "false_positive"].any()
    assert not shown.loc[(shown["key"] == str(SEED)) & (shown["x1"] == x0 + 5), "false_positive"].any()


class _Predicted(Run):
    """Return a run whose detector predicts the given boxes."""

    predictions = found = None

    def predicted(self, name):
        return self.found


def test_decimated_meshes_keep_shape_and_vertex_attributes(made):
    vertices, faces = thinned_terrain(Run.at(made), 3)
    assert faces.to_numpy().max() < len(vertices)
    assert set(vertices["rock"]) == {-1, 1, 2}
    own = vertices[vertices["rock"] == 2]
    np.testing.assert_allclose(own["error_mm"], 6.0)
    np.testing.assert_allclose(np.sort(vertices[vertices["rock"] == 1]["support"]), np.arange(8) / 7)
    assert np.linalg.norm(own[["nx", "ny", "nz"]], axis=1) == pytest.approx(1)


def test_vertices_of_a_grid_cell_are_replaced_by_their_mean():
    sand = make_sand()
    thin, became = clustered(sand, 0.2)
    assert len(thin.vertices) < len(sand.vertices) / 5
    assert became.min() >= 0
    for number in (0, len(thin.vertices) // 2):
        np.testing.assert_allclose(thin.vertices[number], sand.vertices[became == number].mean(axis=0))
    assert np.abs(thin.vertices[:, 2]).max() < 0.031


def test_cameras_have_the_localised_poses(made):
    around = terrain_setup(Run.at(made), 3)
    left = next(one for one in around["cameras"] if one["camera"] == "L")
    pose = np.array(left["sandbox_from_camera"]).reshape(4, 4)
    np.testing.assert_allclose(pose, RIG.sandbox_from("L").matrix, atol=1e-4)
    assert set(around["lamps"]) == {"30", "180", "270", "350"}


def test_polygons_of_twins_cover_the_pixels_of_the_instance_map(made):
    rings = outlines_of_twins(made / "renders/instances/Terrain03/03_A_off_30_L.png")
    (ring,) = [one["ring"] for one in rings if (one["kind"], one["rock"]) == ("rock", 1)]
    points = np.array(ring).reshape(-1, 2)
    x0, y0, x1, y1 = np.round(boxes_of(SEED)["rock", 1])
    assert abs(signed_area(points.astype(float))) == pytest.approx((x1 - x0) * (y1 - y0), rel=0.02)


def test_facts_of_rocks_require_the_table_of_rocks_only(made):
    assert facts_of_rocks(Run.at(made), 3)["size_m"].tolist() == [0.2, 0.06]
    assert facts_of_rocks(Run(made / "nothing"), 3).empty
