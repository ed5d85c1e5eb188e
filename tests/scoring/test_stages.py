import json
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from polarsim.errors import FormatError
from polarsim.formats import obj, png, yolo
from polarsim.formats.tables import PHOTO_COLUMNS, key_columns, label_table, read_csv, read_parquet, write_parquet
from polarsim.geometry import boxes as box_geometry
from polarsim.geometry.poses import Pose
from polarsim.photo import PhotoKey
from polarsim.run_files.instances import GROUND, SHADOW_IDS
from polarsim.run_files.rigs import LocalisedRig, read_localised, write_localised
from polarsim.schemas.evaluation import LABEL_PAIRS
from polarsim.scoring.cameras import score_cameras
from polarsim.scoring.labels import score_labels, task_of, visible
from polarsim.scoring.rock_pairs import RockPairs, pair_rocks, recall_and_precision
from polarsim.scoring.rocks import score_rocks
from polarsim.scoring.twins import score_twins
from polarsim.site import polar
from tests.support.label_rows import label_row
from tests.support.polar_photos import SIZE
from tests.support.polar_rig import default_rig
from tests.support.polar_survey import surveyed_pose

OTHER_FROM_TRUTH = Pose.from_rotvec(np.array([0.01, -0.02, 0.05]), np.array([0.1, -0.05, 0.02]))
BOX = [100.0, 200.0, 160.0, 240.0]


def metrics(path):
    table = read_csv(path)
    return {(row["subject"], row["metric"]): row["value"] for row in table.to_dict("records")}


# cameras


def cameras_scored(folder, **changes):
    """Return the metrics of cameras in `folder/own` against `folder/truth`, or with other arguments."""
    paths = {"cameras": folder / "own/cameras", "truth": folder / "truth", "meshes": folder / "meshes"}
    score_cameras(
        site=polar(), terrain=3, evaluation=folder / "q.csv", **{**paths, "matches": None, "annotated": None, **changes}
    )
    return metrics(folder / "q.csv")


def test_cameras_that_are_correct_up_to_the_frame_have_no_error_after_alignment(tmp_path, world):
    world.write(tmp_path / "truth")
    world.write(tmp_path / "own", OTHER_FROM_TRUTH)
    found = cameras_scored(tmp_path)
    assert found["worst position", "position_error_aligned"] < 1e-3  # mm
    assert found["worst position", "angle_error_aligned"] < 1e-4
    assert found["A", "angle_error_before"] == pytest.approx(np.degrees(np.linalg.norm([0.01, -0.02, 0.05])), rel=1e-4)
    assert found["C R", "reprojection_p90"] < 1e-3
    assert found["A (scans)", "rmse_mm"] == 1.5
    assert ("worst lamp", "direction_error") in found
    (tmp_path / "truth/lamps.json").unlink()
    assert ("worst lamp", "direction_error") not in cameras_scored(tmp_path)


def test_an_error_of_a_single_camera_is_measured_in_millimetres_and_pixels(tmp_path, world):
    world.write(tmp_path / "truth")
    world.write(tmp_path / "own")
    path = tmp_path / "own/cameras/PosA.json"
    localised = read_localised(path)
    left = localised.sandbox_from_left
    up = Pose(left.rotation, left.translation + np.array([0, 0, 0.01]))
    write_localised(path, LocalisedRig(localised.rig, up))
    found = cameras_scored(tmp_path)
    assert found["A", "position_error_before"] == pytest.approx(10)
    assert 3 < found["A", "position_error_aligned"] < 7  # the alignment removes half of the error
    assert found["A L", "reprojection_median"] > 1


def test_a_single_position_has_no_errors_after_alignment(tmp_path, world):
    world.write(tmp_path / "truth")
    replace(world, poses={"A": world.poses["A"]}).write(tmp_path / "own")
    assert not [name for _, name in cameras_scored(tmp_path) if name.endswith("aligned")]


def test_cameras_are_scored_on_consensus_boxes_of_a_view(tmp_path, cube):
    rig = LocalisedRig(default_rig(), surveyed_pose("A"))
    write_localised(tmp_path / "cameras" / "PosA.json", rig)
    points = {1: (0.2, 0.4, 0.0), 2: (-0.5, -0.3, 0.0), 3: (0.9, -0.7, 0.0)}
    for rock, position in points.items():
        obj.write_obj(tmp_path / "meshes" / obj.rock_name(3, rock), cube(position, 0.15), "rock")
    for camera in "LR":
        around = [
            box_geometry.box_around_points(rig.project(camera, cube(position, 0.15).vertices))
            for position in points.values()
        ]
        for azimuth, off_px in (("30", 0.0), ("180", 0.0), ("270", 30.0)):  # a single azimuth with poor annotations
            moved = np.array(around) + (off_px if camera == "R" else 0.0)
            path = tmp_path / "annotated" / f"03_A_off_{azimuth}_{camera}_0256.txt"
            path.parent.mkdir(exist_ok=True)
            yolo.write_boxes(path, np.zeros(3, int), moved, size=SIZE)
    found = cameras_scored(tmp_path, cameras=tmp_path / "cameras", truth=None, annotated=tmp_path / "annotated")
    for camera in "LR":
        assert found[f"all boxes of {camera}", "box_iou_mean"] > 0.95  # sides are trimmed at the foot
        assert found[f"all boxes of {camera}", "box_dy_median"] < 0.5


def test_matches_of_meshes_and_boxes_give_iou_and_offsets_and_may_be_missing(tmp_path, world):
    world.write(tmp_path)
    matches = pd.DataFrame({"position": list("AAC"), "rock": [1, 2, 1], "iou": [0.6, 0.8, 0.7]})
    write_parquet(tmp_path / "matches.parquet", matches.assign(dx_px=[-3.0, 1, 5], dy_px=[0.0, 0, -1]))
    paths = {"cameras": tmp_path / "cameras", "truth": None}
    found = cameras_scored(tmp_path, **paths, matches=tmp_path / "matches.parquet")
    assert found["A", "box_iou_mean"] == pytest.approx(0.7)
    assert found["all positions", "box_dx_median"] == 3
    without = cameras_scored(tmp_path, **paths, matches=tmp_path / "none.parquet")
    assert not [name for _, name in without if name.startswith("box")]


# rocks


def test_perfect_meshes_in_another_frame_have_no_distance_and_full_recall(tmp_path, world):
    world.write(tmp_path / "truth")
    world.write(tmp_path / "own", OTHER_FROM_TRUTH)
    found = scored_rocks(tmp_path)
    assert found["paired rocks", "surface_distance_p90"] < 0.05  # mm
    assert found["ground", "surface_distance_p90"] < 0.05
    assert found["rocks of 8 cm and more", "recall"] == found["rocks of 5 to 8 cm", "recall"] == 1
    assert found["rocks of 8 cm and more", "precision"] == 1
    assert found["rock meshes", "watertight_share"] == 1
    assert found["paired rocks", "volume_ratio_median"] == pytest.approx(1)


def test_rocks_three_millimetres_too_large_are_three_millimetres_off_and_the_ground_is_not(tmp_path, world):
    world.write(tmp_path / "truth")
    world.write(tmp_path / "own", grown=0.003)
    found = scored_rocks(tmp_path)
    assert found["paired rocks", "surface_distance_median"] == pytest.approx(3, abs=0.3)
    assert found["ground", "surface_distance_median"] < 0.3


def test_a_missed_rock_lowers_recall_of_its_size_only(tmp_path, world):
    world.write(tmp_path / "truth")
    world.write(tmp_path / "own", rocks=(1,))
    found = scored_rocks(tmp_path)
    assert found["rocks of 8 cm and more", "recall"] == 1
    assert found["rocks of 5 to 8 cm", "recall"] == 0
    assert ("rocks of 5 to 8 cm", "precision") not in found


def test_a_terrain_without_rocks_is_scored_by_its_ground(tmp_path, world):
    world.write(tmp_path / "truth", rocks=())
    world.write(tmp_path / "own", OTHER_FROM_TRUTH, rocks=())
    found = scored_rocks(tmp_path)
    assert found["rocks", "count"] == 0
    assert found["ground", "surface_distance_p90"] < 0.05
    assert ("paired rocks", "surface_distance_median") not in found


def test_without_truth_there_are_counts_and_soundness(tmp_path, world):
    world.write(tmp_path / "own")
    found = scored_rocks(tmp_path, truth=None)
    assert set(read_csv(tmp_path / "q.csv")["against"]) == {"own"}
    assert read_csv(tmp_path / "scores.csv")["rock"].tolist() == [-1, 1, 2]
    assert found["rocks", "count"] == 2


def test_rocks_are_paired_one_to_one_within_half_their_size():
    true = rock_rows([(0, 0, 0.2), (1, 0, 0.1)])
    found = rock_rows([(0.04, 0, 0.18), (0.05, 0, 0.06), (1.06, 0, 0.1)])
    pairs = pair_rocks(true, found)
    assert (pairs.true.tolist(), pairs.found.tolist()) == ([0], [0])
    seen = np.array([True, False])
    metrics = recall_and_precision(true, found, pairs, seen)
    shares = {(metric.subject, metric.metric): metric.value for metric in metrics}
    assert shares["rocks of 8 cm and more", "recall"] == 0.5
    assert shares["rocks of 8 cm and more", "recall_seen"] == 1
    assert shares["rocks of 8 cm and more", "precision"] == 0.5
    assert shares["rocks of 5 to 8 cm", "precision"] == 0
    assert shares["paired rocks", "size_error_median"] == pytest.approx(20)
    assert pair_rocks(true, rock_rows([])).true.size == 0
    nothing = RockPairs(np.zeros(0, int), np.zeros(0, int))
    assert recall_and_precision(rock_rows([]), rock_rows([]), nothing, np.zeros(0, bool)) == []


def scored_rocks(folder, **changes):
    own = folder / "own"
    inputs = {"rocks": own / "rocks.parquet", "meshes": own / "meshes", "truth": folder / "truth", "inventory": None}
    outputs = {"evaluation": folder / "q.csv", "scores": folder / "scores.csv", "offsets": folder / "offsets.parquet"}
    score_rocks(
        site=polar(), terrain=3, located=own / "cameras", cameras=own / "cameras", **{**inputs, **outputs, **changes}
    )
    return metrics(folder / "q.csv")


def rock_rows(rocks):
    names = ["rock", "x", "y", "z", "size_m", "height_m", "volume_m3"]
    rows = [(number, x, y, 0.0, size, size / 2, size**3) for number, (x, y, size) in enumerate(rocks, 1)]
    return pd.DataFrame(rows, columns=names).astype(dict.fromkeys(names[1:], float))


# labels

SEEDS = [PhotoKey.parse(name) for name in ("03_A_off_30_L_0256", "03_A_off_180_L_0256")]


@pytest.mark.parametrize(
    ("name", "task"),
    [
        ("03_A_off_30_L_0256", None),
        ("03_A_off_30_L_1024", "other exposures"),
        ("03_A_on_180_L_0256", "light on"),
        ("03_A_on_180_R_0256", "Left to Right"),
        ("03_A_off_270_L_0256", "another azimuth"),
        ("03_A_off_270_R_0256", "another azimuth"),
        ("03_A_on_no_R_2048", "no Sun"),
        ("03_B_off_30_L_0256", "position without seed"),
        ("04_A_off_30_L_0256", "position without seed"),
    ],
)
def test_the_task_of_a_photo_is_the_most_difficult_required_step(name, task):
    assert task_of(PhotoKey.parse(name), SEEDS) == task


def label_rows(key, *boxes, **told):
    """Rows of a label table: boxes as (kind, x0, y0, x1, y1)."""
    return [label_row(key, kind, box=box, **told) for kind, *box in boxes]


def labels_scored(folder, keys, rows, truth="truth"):
    """Return the metrics of rows of photos."""
    write_parquet(folder / "labels.parquet", rows if isinstance(rows, pd.DataFrame) else label_table(rows))
    score_labels(
        site=polar(),
        terrain=3, keys=[PhotoKey.parse(key) for key in keys], table=folder / "labels.parquet", truth=folder / truth,
        seeds=folder / "seeds", evaluation=folder / "q.csv", pairs=folder / "pairs.parquet",
    )  # fmt: skip
    return metrics(folder / "q.csv")


def test_labels_are_scored_by_task_without_seeds(tmp_path):
    names = ["03_A_off_30_L_0256", "03_A_off_30_L_0512", "03_A_off_30_R_0256", "03_A_off_30_R_0512"]
    shadow = [300.0, 300.0, 400.0, 330.0]
    rows = []
    for name in names:
        yolo.write_boxes(tmp_path / f"truth/{name}.txt", [0, 1], [BOX, shadow], size=SIZE)
        rows += label_rows(name, ("rock", *BOX), *([("shadow", *shadow)] if "_L_" in name else []))
    yolo.write_boxes(tmp_path / "seeds/03_A_off_30_L_0256.txt", [0], [BOX], size=SIZE)
    yolo.write_boxes(tmp_path / "truth/03_A_off_30_R_1024.txt", [0], [BOX], size=SIZE)
    found = labels_scored(tmp_path, names, rows)
    assert found["rock: other exposures", "f1"] == 1
    assert found["rock: Left to Right", "f1"] == 1
    assert found["shadow: Left to Right", "recall"] == 0
    assert found["shadow: all but seeds", "recall"] == pytest.approx(1 / 3)
    assert np.isnan(found["shadow: Left to Right", "precision"])
    assert found["photos with truth", "without_label_file"] == 1
    table = read_csv(tmp_path / "q.csv")
    assert table.loc[(table["subject"] == "rock: all but seeds") & (table["metric"] == "f1"), "n"].tolist() == [3]
    assert found["seeds", "photos_annotated"] == 1
    assert set(table.loc[table["subject"] != "seeds", "against"]) == {"labels"}
    pairs = read_parquet(tmp_path / "pairs.parquet", list(LABEL_PAIRS.dtypes))
    assert "03_A_off_30_L_0256" not in set(pairs["key"])  # the seed
    assert "03_A_off_30_R_1024" not in set(pairs["key"])  # annotated by a person, but not labelled by the run
    assert pairs["hit"].sum() == 4


def test_a_labelled_photo_without_a_row_misses_all_true_boxes(tmp_path):
    name = "03_A_off_30_R_0256"
    yolo.write_boxes(tmp_path / f"truth/{name}.txt", [0], [BOX], size=SIZE)
    (tmp_path / "seeds").mkdir()
    found = labels_scored(tmp_path, [name], [])
    assert found["rock: all but seeds", "recall"] == 0
    assert found["photos with truth", "without_label_file"] == 0
    assert ("rock: confidence", "ece") not in found


def test_boxes_in_empty_photos_of_the_analog_are_false_positives(tmp_path):
    lit, dark = "03_A_off_30_R_0256", "03_A_off_no_R_0256"
    true = label_table(label_rows(lit, ("rock", *BOX), source="truth")).assign(visible_px=500, contrast=-50.0)
    tiny = true.assign(rock=2, x0=700.0, visible_px=3)
    unseen = true.assign(rock=3, x0=700.0, contrast=4.0)
    write_parquet(tmp_path / "true.parquet", pd.concat([true, tiny, unseen]))
    (tmp_path / "seeds").mkdir()
    yolo.write_boxes(tmp_path / "seeds/03_A_off_30_L_0256.txt", [0], [BOX], size=SIZE)
    rows = [row for key in (lit, dark) for row in label_rows(key, ("rock", *BOX), confidence=0.75)]
    found = labels_scored(tmp_path, [lit, dark], rows, truth="true.parquet")
    assert found["rock: Left to Right", "recall"] == 1
    assert found["rock: no Sun", "precision"] == 0
    assert found["rock: all but seeds", "precision"] == 0.5
    assert found["rock: confidence", "ece"] == pytest.approx(0.25)  # confidence 0.75, half are correct
    assert found["rock: confidence", "brier"] == pytest.approx((0.75**2 + 0.25**2) / 2)


def test_a_true_shadow_below_the_minimum_width_is_not_annotated(tmp_path):
    name = "03_A_on_no_L_2048"
    true = label_table(label_rows(name, ("shadow", *BOX), source="truth")).assign(visible_px=60, contrast=-500.0)
    line = true.assign(rock=2, x0=700.0, width_px=1)
    rock = label_table(label_rows(name, ("rock", *BOX), source="truth")).assign(
        visible_px=60, contrast=500.0, width_px=1
    )
    write_parquet(tmp_path / "true.parquet", pd.concat([true.assign(width_px=3), line, rock]))
    (tmp_path / "seeds").mkdir()
    yolo.write_boxes(tmp_path / "seeds/03_A_off_30_L_0256.txt", [0], [BOX], size=SIZE)
    rows = label_rows(name, ("shadow", *BOX)) + label_rows(name, ("rock", *BOX))
    found = labels_scored(tmp_path, [name], rows, truth="true.parquet")
    assert found["shadow: no Sun", "recall"] == 1
    assert found["rock: no Sun", "recall"] == 1


def test_an_invalid_annotated_file_is_skipped_but_an_invalid_result_is_an_error(tmp_path):
    names = ["03_A_off_30_R_0256", "03_A_off_30_R_0512"]
    for name in names:
        yolo.write_boxes(tmp_path / f"truth/{name}.txt", [0], [BOX], size=SIZE)
    yolo.write_boxes(tmp_path / "seeds/03_A_off_30_L_0256.txt", [0], [BOX], size=SIZE)
    (tmp_path / "truth/03_A_off_30_R_0512.txt").write_text("name0 0.5 0.5\n")
    rows = [row for name in names for row in label_rows(name, ("rock", *BOX))]
    assert labels_scored(tmp_path, names, rows)["rock: Left to Right", "f1"] == 1
    with pytest.raises(FormatError, match=r"labels\.parquet: column 'confidence'"):
        labels_scored(tmp_path, [], label_table(rows).drop(columns="confidence"))


# twins


def test_twins_are_scored_by_boxes_and_pixels_if_available(tmp_path):
    key = PhotoKey.parse("03_A_off_30_L_0256")
    photo = np.full((1216, 1936), 16 + 800, np.uint16)
    png.write_png(tmp_path / "photo.png", photo)
    shaded = np.arange(1936) >= 968
    png.write_png(tmp_path / f"hapke/{key}.png", np.where(shaded, photo, photo + 800).astype(np.uint16))
    ids = np.where(shaded, SHADOW_IDS + 1, GROUND).astype(np.uint16)
    png.write_png(tmp_path / "instances/03_A_off_30_L.png", np.broadcast_to(ids, photo.shape))
    yolo.write_boxes(tmp_path / f"boxes/{key}.txt", [0], [BOX], size=SIZE)
    yolo.write_boxes(tmp_path / f"truth/{key}.txt", [0, 0], [BOX, [500, 500, 540, 530]], size=SIZE)
    row = {**dict.fromkeys(PHOTO_COLUMNS, 0), **key_columns(key), "path": str(tmp_path / "photo.png"), "sha256": ""}
    write_parquet(tmp_path / "photos.parquet", pd.DataFrame([row]))
    (tmp_path / "none").mkdir()
    twins = {"hapke": tmp_path / "hapke", "principled": tmp_path / "none"}
    arguments = {
        "terrain": 3,
        "boxes": tmp_path / "boxes",
        "truth": tmp_path / "truth",
        "twins": twins,
        "others": {},
        "materials": None,
        "light": None,
        "meshes": tmp_path / "meshes",
        "covers": None,
        "drawn": None,
        "instances": tmp_path / "instances",
        "evaluation": tmp_path / "q.csv",
        "appearance": tmp_path / "pairs.parquet",
    }
    score_twins(site=polar(), **arguments, photos=tmp_path / "photos.parquet")
    found = metrics(tmp_path / "q.csv")
    assert found["rendered rock: all", "recall"] == found["rendered rock: camera L", "recall"] == 0.5
    assert found["hapke", "log2_twin_over_photo_median"] == pytest.approx(1)
    assert not [subject for subject, _ in found if subject == "principled"]
    pair = read_parquet(tmp_path / "pairs.parquet").iloc[0]
    assert (pair["key"], pair["model"], pair["relation"]) == (str(key), "hapke", "not fitted")
    # A quarter of 53 % of the rows and of 80 % of the columns; the shadow in the right half does not count.
    assert (pair["lit_px"], pair["stops"]) == (161 * 194, 0)
    for lamp, relation in (("30", "in place"), ("180", "held out")):
        fit = {"azimuths": [lamp], "positions": ["A"], "models": {"hapke": {"lamps": {lamp: 1.0}}}}
        (tmp_path / "materials.json").write_text(json.dumps(fit))
        score_twins(site=polar(), **{**arguments, "materials": tmp_path}, photos=tmp_path / "photos.parquet")
        assert read_parquet(tmp_path / "pairs.parquet")["relation"].tolist() == [relation]
        assert (f"hapke, {relation}", "ssim_median") in metrics(tmp_path / "q.csv")
    write_parquet(tmp_path / "photos.parquet", pd.DataFrame([row])[:0])
    score_twins(site=polar(), **{**arguments, "truth": None}, photos=tmp_path / "photos.parquet")
    assert len(read_csv(tmp_path / "q.csv")) == len(read_parquet(tmp_path / "pairs.parquet")) == 0


def test_an_object_visible_in_a_single_exposure_is_annotated_in_the_bracket():
    keys = [PhotoKey.parse(f"03_A_off_30_L_{ms}") for ms in ("0064", "0256")]
    rows = [
        dict(key_columns(key), kind="rock", rock=rock, contrast=contrast)
        for key, contrast in zip(keys, (3.0, -30.0), strict=True)
        for rock in (1, 2)
    ]
    table = pd.DataFrame(rows)
    table.loc[table["rock"] == 2, "contrast"] = 3.0
    assert visible(table)[["key", "rock"]].to_numpy().tolist() == [[str(key), 1] for key in keys]


@settings(max_examples=30)
@given(
    st.lists(st.tuples(st.floats(0, 0.6), st.floats(0, 0.6)), min_size=1, max_size=6),
    st.lists(st.tuples(st.floats(0, 0.6), st.floats(0, 0.6)), min_size=1, max_size=6),
)
def test_the_number_of_matched_rocks_is_maximal(true, found):
    from scipy.sparse import csr_array
    from scipy.sparse.csgraph import maximum_bipartite_matching

    first, second = (rock_rows([(x, y, 0.5) for x, y in part]) for part in (true, found))
    pairs = pair_rocks(first, second)
    distance = np.linalg.norm(np.array(true)[:, None] - np.array(found)[None], axis=-1)
    assert (distance[pairs.true, pairs.found] < 0.25).all()
    possible = maximum_bipartite_matching(csr_array(distance < 0.25), perm_type="column")
    assert len(pairs.true) == (possible >= 0).sum()


def test_three_distant_pairs_are_preferred_to_two_near_pairs():
    true = rock_rows([(x, 0, 0.2) for x in (0.0, 0.099, 0.198)])
    found = rock_rows([(x, 0, 0.2) for x in (0.099, 0.198, 0.297)])
    assert pair_rocks(true, found).found.tolist() == [0, 1, 2]
