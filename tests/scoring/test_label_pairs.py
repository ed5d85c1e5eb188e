import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from polarsim.formats.tables import label_table
from polarsim.photo import PhotoKey
from polarsim.schemas.evaluation import LABEL_PAIRS
from polarsim.scoring.label_pairs import pair_labels, pair_photo
from polarsim.scoring.score import MatchCounts, PhotoLabels, count_photo
from tests.support.label_rows import label_row

KEY = PhotoKey.parse("03_A_off_30_R_0256")


def labels(*boxes, kind=0):
    return PhotoLabels(np.full(len(boxes), kind), np.array(boxes, float).reshape(-1, 4))


def label_rows(key, *boxes, **told):
    """Rows of a label table; rock ids count from 1."""
    told = {"source": "fused", "confidence": 0.8} | told
    return [label_row(key, rock=rock, box=box, **told) for rock, box in enumerate(boxes, 1)]


def paired(wanted, rows, task="Left to Right", against="labels", usual_ms=256):
    return pair_labels(wanted, label_table(rows), dict.fromkeys(wanted, task), against, usual_ms)


def test_pairs_missed_boxes_and_unmatched_labels_have_a_row_each():
    true = labels([0, 0, 20, 45], [100, 0, 110, 10])
    found = paired({KEY: true}, label_rows(KEY, [0, 0, 20, 36], [300, 0, 316, 4]))
    hit, missed, extra = (found.iloc[row] for row in range(3))
    assert (hit["hit"], hit["rock"], hit["source"], hit["confidence"], hit["iou"]) == (True, 1, "fused", 0.8, 0.8)
    assert (hit["truth_px"], hit["label_px"]) == (30, pytest.approx(720**0.5))
    assert (missed["hit"], missed["rock"], missed["source"], missed["truth_px"]) == (False, -1, "", 10)
    assert missed[["confidence", "label_px", "iou", "x0"]].isna().all()
    assert (extra["hit"], extra["rock"], extra["label_px"], extra["x0"]) == (False, 2, 8, 300)
    assert np.isnan(extra["truth_px"])


def test_photos_without_task_are_excluded_and_the_table_may_be_empty():
    none = paired({KEY: labels([0, 0, 10, 10])}, [], task=None)
    assert len(none) == 0
    types = {name: "int64" if kind == "terrain" else kind for name, kind in LABEL_PAIRS.dtypes.items()}
    assert {name: str(kind) for name, kind in none.dtypes.items()} == types


@pytest.mark.parametrize(
    ("key", "against", "annotated"),
    [
        ("03_A_off_30_R_0128", "truth", True),
        ("03_A_off_30_R_0064", "truth", False),  # not annotated, but known in the analog
        ("03_A_off_30_R_0064", "labels", True),  # somebody did
    ],
)
def test_shadows_are_annotated_in_photos_with_true_shadows_and_enough_exposure(key, against, annotated):
    key = PhotoKey.parse(key)
    true = PhotoLabels(np.array([0, 1]), np.array([[0, 0, 10, 10], [50, 0, 90, 10]], float))
    found = paired({key: true}, label_rows(key, [200, 0, 240, 10], kind="shadow"), against=against)
    assert found["kind"].tolist() == ["rock", "shadow", "shadow"]
    assert found["annotated"].tolist() == [False, annotated, annotated]
    longer = paired({key: true}, [], against="truth", usual_ms=2 * key.exposure_ms + 1)
    assert not longer["annotated"].any()


def test_a_label_in_a_photo_without_true_shadow_is_not_annotated():
    found = paired({KEY: labels([0, 0, 10, 10])}, label_rows(KEY, [0, 0, 10, 10], kind="shadow"))
    assert found.loc[found["kind"] == "shadow", "annotated"].tolist() == [False]


def test_copies_of_a_photo_have_separate_labels():
    copies = [KEY.with_exposure(exposure) for exposure in (64, 128, 256)]
    rows = [row for n, key in enumerate(copies) for row in label_rows(key, [0, 0, 9, 9], confidence=n / 4)]
    found = paired(dict.fromkeys(copies, labels([0, 0, 10, 10])), rows)
    assert list(zip(found["exposure_ms"], found["confidence"], strict=True)) == [(64, 0), (128, 0.25), (256, 0.5)]


boxes = st.lists(
    st.tuples(*[st.integers(0, 30)] * 2, *[st.integers(2, 12)] * 2).map(
        lambda b: (b[0], b[1], b[0] + b[2], b[1] + b[3])
    ),
    max_size=6,
)
sets = st.tuples(boxes, boxes).map(
    lambda two: PhotoLabels(
        np.repeat([0, 1], [len(two[0]), len(two[1])]), np.array(two[0] + two[1], float).reshape(-1, 4)
    )
)


@settings(max_examples=60, deadline=None)
@given(truth=sets, found=sets)
def test_rows_add_up_to_the_counts_of_the_scores(truth, found):
    pairs = pair_photo(truth, found)
    for number, counts in enumerate(count_photo(truth, found).values()):
        of_kind = pairs.kind == number
        true, hit = of_kind & ~np.isnan(pairs.truth[:, 0]), of_kind & ~np.isnan(pairs.iou)
        told = of_kind & (pairs.label >= 0)
        summed = MatchCounts(1, hit.sum(), (told & ~hit).sum(), (true & ~hit).sum(), pairs.iou_best[true].sum())
        assert (summed.tp, summed.fp, summed.fn) == (counts.tp, counts.fp, counts.fn)
        assert summed.iou_sum == pytest.approx(counts.iou_sum)
    used = pairs.label[pairs.label >= 0]
    assert sorted(used) == list(range(len(found.classes)))  # every label once
    assert (found.classes[used] == pairs.kind[pairs.label >= 0]).all()
