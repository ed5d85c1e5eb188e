import contextlib
import io

import numpy as np
import pytest

from polarsim.detect.metrics import ANY_AREA, IOU_THRESHOLDS, precision_at_recalls, rank

UNIT = np.array([[0.0, 0, 100, 100]])


def average_precision(labels, predictions, confidences, thresholds=IOU_THRESHOLDS, area=ANY_AREA[0]):
    """Return average precision at each IoU threshold for the labels of a range of area."""
    return precision_at_recalls(ranked(labels, predictions, confidences, thresholds, [area])).mean(axis=1)


def ranked(labels, predictions, confidences, *rest):
    rows = [np.column_stack([*boxes.T, sure]) for boxes, sure in zip(predictions, confidences, strict=True)]
    return rank(labels, rows, *rest)


def half_missing(share: float) -> np.ndarray:
    """Return a box inside `UNIT` with IoU `share`."""
    return np.array([[0.0, 0, 100, 100 * share]])


def test_a_box_counts_up_to_its_iou():
    found = average_precision([UNIT], [half_missing(0.72)], [np.array([0.9])])
    np.testing.assert_allclose(found, [1] * 5 + [0] * 5)  # 0.5, 0.55 ... 0.7 are reached, 0.75 is not


def test_a_second_box_on_the_same_label_is_false():
    both = np.concatenate([UNIT, UNIT, UNIT + 1000])
    labels = [np.concatenate([UNIT, UNIT + 1000])]
    found = average_precision(labels, [both], [np.array([0.9, 0.8, 0.7])])
    np.testing.assert_allclose(found, (51 * 1 + 50 * 2 / 3) / 101)  # the third box is the second true positive


def test_precision_is_zero_without_detections_and_missing_without_labels():
    np.testing.assert_array_equal(average_precision([UNIT], [np.zeros((0, 4))], [np.zeros(0)]), 0)
    assert np.isnan(average_precision([np.zeros((0, 4))], [UNIT], [np.ones(1)])).all()


def random_boxes(rng, count):
    low = rng.uniform(0, 900, (count, 2))
    return np.concatenate([low, low + rng.uniform(20, 200, (count, 2))], axis=1)


def random_case(rng, pictures=12):
    """Return labels, predictions and confidences: jittered copies, duplicates, ties and false positives."""
    labels, predictions, confidences = [], [], []
    for _ in range(pictures):
        label = random_boxes(rng, rng.integers(0, 12))
        copies = np.concatenate([label + rng.normal(0, spread, label.shape) for spread in (2, 12, 30)])
        prediction = np.concatenate([copies[copies[:, 2:].min(axis=1) > 0], random_boxes(rng, rng.integers(0, 6))])
        prediction[:, 2:] = np.maximum(prediction[:, 2:], prediction[:, :2] + 1)
        labels.append(label)
        predictions.append(prediction)
        confidences.append(rng.uniform(0, 1, len(prediction)).round(2))  # rounded: ties
    return labels, predictions, confidences


def coco_precision(labels, predictions, confidences, area=(0, 1e10)):
    """Return average precision (t,) of pycocotools without the limit of 100 boxes per image; -1 without labels."""
    from pycocotools.coco import COCO
    from pycocotools.cocoeval import COCOeval

    def records(boxes_of, scores_of=None):
        found = []
        for picture, boxes in enumerate(boxes_of):
            for n, (x0, y0, x1, y1) in enumerate(boxes.tolist()):
                record = {"id": len(found) + 1, "image_id": picture, "category_id": 1, "iscrowd": 0}
                record |= {"bbox": [x0, y0, x1 - x0, y1 - y0], "area": (x1 - x0) * (y1 - y0)}
                if scores_of is not None:
                    record["score"] = float(scores_of[picture][n])
                found.append(record)
        return found

    with contextlib.redirect_stdout(io.StringIO()):
        truth = COCO()
        truth.dataset = {
            "images": [{"id": n} for n in range(len(labels))],
            "annotations": records(labels),
            "categories": [{"id": 1}],
        }
        truth.createIndex()
        rating = COCOeval(truth, truth.loadRes(records(predictions, confidences)), "bbox")
        rating.params.maxDets = [1, 10, 1000]
        rating.params.areaRng, rating.params.areaRngLbl = [list(area)], ["all"]
        rating.evaluate()
        rating.accumulate()
    return rating.eval["precision"][:, :, 0, 0, 2].mean(axis=1)


@pytest.mark.parametrize("seed", range(4))
def test_average_precision_is_that_of_pycocotools(seed):
    case = random_case(np.random.default_rng(seed))
    np.testing.assert_allclose(average_precision(*case, IOU_THRESHOLDS), coco_precision(*case), atol=1e-9)


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("area", [(0, 70**2), (70**2, 120**2), (120**2, 1e10)])
def test_average_precision_of_a_size_class_is_that_of_pycocotools(seed, area):
    case = random_case(np.random.default_rng(seed))
    sizes = np.concatenate([np.prod(label[:, 2:] - label[:, :2], axis=1) for label in case[0]])
    assert ((sizes >= area[0]) & (sizes <= area[1])).mean() > 0.05  # some are of the class
    np.testing.assert_allclose(average_precision(*case, IOU_THRESHOLDS, area), coco_precision(*case, area), atol=1e-9)


def test_a_weight_is_a_number_of_copies(rng):
    labels, predictions, confidences = random_case(rng)
    confidences = [rng.uniform(size=len(confidence)) for confidence in confidences]  # no ties: copies stay together
    weights = rng.integers(0, 4, len(labels))
    copied = [
        [part for part, n in zip(parts, weights, strict=True) for _ in range(n)]
        for parts in (labels, predictions, confidences)
    ]
    weighted = precision_at_recalls(ranked(labels, predictions, confidences), weights=weights.astype(float)).mean(
        axis=1
    )
    np.testing.assert_allclose(weighted, average_precision(*copied), atol=1e-12)
