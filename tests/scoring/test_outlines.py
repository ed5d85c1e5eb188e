import numpy as np
import pytest

from polarsim.formats import coco, rle, yolo
from polarsim.formats.coco_annotations import Annotation
from polarsim.formats.release import label_folder, polygon_folder
from polarsim.formats.tables import read_csv
from polarsim.photo import PhotoKey
from polarsim.scoring.metrics import COLUMNS
from polarsim.scoring.outlines import overlaps, score_outlines
from polarsim.site import polar
from tests.support.polar_photos import HEIGHT, WIDTH

POLAR = polar()
SIZE = POLAR.images.size

ROCK_POLYGON, SHADOW_POLYGON = 2, 3
LEFT, RIGHT = (PhotoKey.parse(f"03_A_off_30_{camera}_0256") for camera in "LR")
ROCK, SHADOW = np.array([100.0, 200, 140, 230]), np.array([140.0, 210, 200, 230])


def ring(box):
    x0, y0, x1, y1 = box
    return np.array([[x0, y0], [x1, y0], [x1, y1], [x0, y1]])


def annotation(kind, box, rock=4):
    left, top, right, bottom = box.astype(int)
    return Annotation(kind, rock, box, rle.encode_rle(np.ones((bottom - top, right - left), bool), SIZE, left, top))


@pytest.fixture
def scores(tmp_path):
    """Metrics by subject and name, of polygons and annotations by photo."""

    def run(polygons, annotations, boxes=None):
        for key, annotated in polygons.items():
            yolo.write_polygons(polygon_folder(tmp_path, 3) / f"{key}.txt", annotated, size=SIZE)
        for key, (classes, annotated) in (boxes or {}).items():
            yolo.write_boxes(
                label_folder(tmp_path, 3) / f"{key}.txt", np.array(classes), np.array(annotated), size=SIZE
            )
        coco.write_coco(tmp_path / "coco.json", annotations, POLAR, SIZE)
        score_outlines(
            site=POLAR,
            terrain=3,
            keys=[LEFT, RIGHT],
            annotations=tmp_path / "coco.json",
            root=tmp_path,
            evaluation=tmp_path / "evaluation.csv",
        )
        table = read_csv(tmp_path / "evaluation.csv", COLUMNS)
        return {(row["subject"], row["metric"]): row["value"] for row in table.to_dict("records")}

    return run


def region(mask, left, top):
    rows, columns = np.nonzero(mask)
    return (rows + top) * WIDTH + columns + left


def test_the_overlap_of_masks_is_that_of_their_pixels():
    hollow = np.ones((10, 10))
    hollow[2:8, 2:8] = 0
    others = [(np.ones((10, 10)), 5, 5), (np.ones((10, 10)), 10, 5), (np.ones((4, 4)), 40, 40), (hollow, 5, 5)]
    square = region(*others[0])
    shares = overlaps([square], [region(*other) for other in others])
    np.testing.assert_allclose(shares, [[1, 50 / 150, 0, 0.64]])
    np.testing.assert_allclose(overlaps([square], []), np.zeros((1, 0)))


def test_the_part_of_a_polygon_outside_the_photo_is_ignored(scores):
    at_corner = np.array([WIDTH - 40.0, HEIGHT - 30, WIDTH, HEIGHT])
    moves = np.array([[0, 0, 20, 20], [40, 0, 40, 0], [40, 30, 40, 30]])  # the last two are entirely outside
    annotated = [(ROCK_POLYGON, ring(box)) for box in at_corner + moves]
    metrics = scores({LEFT: annotated}, {LEFT: [annotation("rock", at_corner)]})
    assert metrics["rock outline: seeds' camera", "miou"] == 1
    assert metrics["rock outline: seeds' camera", "precision"] == 1


def test_masks_equal_to_the_polygons_have_a_score_of_1(scores):
    annotated = [(ROCK_POLYGON, ring(ROCK)), (SHADOW_POLYGON, ring(SHADOW))]
    found = [annotation("rock", ROCK), annotation("shadow", SHADOW)]
    metrics = scores({LEFT: annotated, RIGHT: annotated}, {LEFT: found, RIGHT: found})
    for subject in ("rock outline: seeds' camera", "rock outline: Left to Right", "shadow outline: Left to Right"):
        assert metrics[subject, "f1"] == metrics[subject, "miou"] == 1
    assert not any("annotated box" in subject for subject, _ in metrics)  # no annotated boxes


def test_missing_and_displaced_masks_are_misses(scores):
    found = {LEFT: [annotation("rock", ROCK + 100)], RIGHT: []}
    metrics = scores({LEFT: [(ROCK_POLYGON, ring(ROCK))], RIGHT: [(ROCK_POLYGON, ring(ROCK))]}, found)
    assert metrics["rock outline: seeds' camera", "precision"] == 0
    assert metrics["rock outline: Left to Right", "recall"] == 0


def test_polygons_are_compared_with_annotated_boxes(scores):
    annotated = {LEFT: [(ROCK_POLYGON, ring(ROCK)), (SHADOW_POLYGON, ring(SHADOW))]}
    boxes = {LEFT: ([0], [ROCK + np.array([0, 0, 10, 0])])}  # 50 px wide; no shadow box to compare with
    metrics = scores(annotated, {LEFT: []}, boxes)
    assert metrics["rock polygon's box against annotated box: seeds' camera", "miou"] == pytest.approx(0.8, abs=1e-3)
    assert ("shadow polygon's box against annotated box: seeds' camera", "miou") not in metrics


def test_a_terrain_without_polygons_has_no_metrics(scores):
    assert scores({}, {LEFT: []}) == {}
