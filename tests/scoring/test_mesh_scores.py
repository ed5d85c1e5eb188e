import numpy as np
import pandas as pd
import pytest
import trimesh

from polarsim.formats import obj
from polarsim.formats.tables import write_csv
from polarsim.geometry.meshes import Mesh
from polarsim.run_files.scene import read_terrain
from polarsim.scoring.mesh_scores import (
    COLUMNS,
    accuracy,
    contact_share,
    f_score,
    mesh_table,
    soundness_rows,
    surface_iou,
)
from polarsim.scoring.surface import Surface
from polarsim.scoring.true_surface import SurfaceSamples
from tests.support.polar_survey import SANDBOX

LEVEL = Mesh(
    np.array([[-1.0, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]]),
    np.array([[0, 1, 2], [0, 2, 3]]),
)
GROUND = Surface(LEVEL.vertices, LEVEL.faces)


def ball(height, radius=0.05, detail=4):
    made = trimesh.creation.icosphere(detail, radius)
    return Mesh(np.asarray(made.vertices) + np.array([0.2, 0.1, height]), np.asarray(made.faces, np.int64))


def test_an_embedded_rock_touches_the_ground_in_all_directions_and_a_floating_rock_in_none():
    assert contact_share(ball(0.03), GROUND) == 1
    assert contact_share(ball(0.0525), GROUND) < 0.1
    assert contact_share(ball(0.06), GROUND) == 0


def test_a_rock_partly_outside_the_ground_is_in_contact_only_above_the_ground():
    beside = ball(0.03)
    beside = Mesh(beside.vertices + np.array([0.8, 0, 0]), beside.faces)
    assert 0.3 < contact_share(beside, GROUND) < 0.7


def test_heights_are_vertical_and_undefined_outside_the_surface():
    heights = GROUND.height_below(np.array([[0.0, 0.1, 0.3], [0.5, 0, -0.2], [3, 0, 0]]))
    np.testing.assert_allclose(heights[:2], [0.3, -0.2], atol=1e-6)
    assert np.isnan(heights[2])


def test_f_score_is_the_harmonic_mean_of_both_shares():
    assert f_score(np.array([0.001, 0.001, 0.010, 0.010]), np.array([0.0, 0.004])) == pytest.approx(2 / 3)
    assert f_score(np.array([1.0]), np.array([1.0])) == 0
    assert np.isnan(f_score(np.zeros(0), np.zeros(3)))


def samples(rock, offset, other_rock, area=1.0):
    n = len(rock)
    return SurfaceSamples(np.zeros((n, 3)), np.array(rock), np.array(offset), np.array(other_rock), np.full(n, area))


def test_metrics_belong_to_the_detected_rock_of_each_true_rock():
    true = samples([7, 7, -1], [0.001, -0.003, 0.0005], [2, 2, -1])
    metrics = accuracy(true, samples([2, -1], [0.001, 0.0], [7, -1]), {2: 7, 3: 9})
    assert metrics[2]["true_rock"] == 7
    assert metrics[2]["surface_median_mm"] == pytest.approx(2)
    assert metrics[-1]["surface_median_mm"] == pytest.approx(0.5)
    assert 3 not in metrics  # true rock 9 has no visible point


def test_surface_iou_is_the_common_area_over_the_area_of_the_union():
    true = samples([7, 7, 7, -1], [0.0] * 4, [2, 2, -1, 2], area=3.0)  # 6 in both, 3 only in the true rock
    reconstructed = samples([2, 2, 2, -1], [0.0] * 4, [7, -1, 5, -1], area=1.5)  # 3 only in the reconstructed rock
    assert surface_iou(true, reconstructed, true_rock=7, rock=2) == pytest.approx(6 / (9 + 3))


def test_a_folder_gives_a_row_for_the_ground_and_each_rock(tmp_path, rng):
    obj.write_obj(tmp_path / obj.ground_name(1), LEVEL, "ground")
    obj.write_obj(tmp_path / obj.rock_name(1, 4), ball(0.03), "rock")
    obj.write_obj(tmp_path / obj.rock_name(1, 4, decimated=True), ball(0.03, radius=0.052, detail=2), "copy")
    rows = [
        {"mesh": obj.ground_name(1), "made_from": "fitted"},
        {"mesh": obj.rock_name(1, 4), "made_from": "published"},
    ]
    write_csv(tmp_path / "meshes.csv", pd.DataFrame(rows))
    table = mesh_table(soundness_rows(read_terrain(tmp_path, 1, SANDBOX), tmp_path, 1, rng, 500))
    assert list(table.columns) == list(COLUMNS)
    assert table["made_from"].tolist() == ["fitted", "published"]
    ground, rock = table.to_dict("records")
    assert (ground["rock"], ground["watertight"]) == (-1, False)
    assert (rock["rock"], rock["watertight"], rock["copy_watertight"], rock["contact_share"]) == (4, True, 1, 1)
    assert rock["copy_hausdorff_mm"] == pytest.approx(2, abs=0.3)
    assert rock["copy_vertex_share"] == pytest.approx(162 / 2562, abs=1e-6)
