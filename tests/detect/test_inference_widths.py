import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic import ValidationError

from polarsim.detect.inference_widths import ClassInferenceWidths, InferenceWidths, choose_sizes, merge
from polarsim.detect.options import PredictionOptions

BOTH = ClassInferenceWidths.same(InferenceWidths((512, 896), (64.0,)))


def rows(*sides, confidence=0.5, left=0.0, kind=0):
    """Return separate square boxes with the given sides."""
    x0 = left + np.cumsum([0.0, *sides[:-1]]) + 10 * np.arange(len(sides))
    return np.array([(x, 0, x + side, side, confidence, kind) for x, side in zip(x0, sides, strict=True)], float)


def at(narrow, wide):
    return {512: narrow, 896: wide}


def test_small_boxes_come_from_the_wide_image_and_large_boxes_from_the_narrow_image():
    found = merge(at(rows(20, 200), rows(20, 200, left=1000)), BOTH, 0.5, 1936)
    assert sorted(found[:, 0].tolist()) == [30.0, 1000.0]  # 200 px of the narrow image, 20 px of the wide image


def test_a_rock_at_the_gate_is_found_at_both_widths_and_kept_once():
    found = merge(at(rows(64, confidence=0.4), rows(64, confidence=0.6)), BOTH, 0.5, 1936)
    assert found[:, 4].tolist() == [0.6]
    other = merge(at(rows(64, confidence=0.4), rows(64, confidence=0.6, kind=1)), BOTH, 0.5, 1936)
    assert other[:, 5].tolist() == [1, 0]  # a rock and its shadow do not suppress each other


def test_gates_follow_the_size_of_the_picture():
    found = merge(at(rows(18), rows(18, left=500)), BOTH, 0.5, 484)
    assert found[:, 0].tolist() == [0.0, 500.0]  # the gate of a quarter photo is 16 px, so 18 px is in both ranges


@given(st.lists(st.floats(1, 500), min_size=1, max_size=8))
def test_every_box_is_in_the_range_of_a_width(sides):
    wide = rows(*sides, confidence=0.3)
    found = merge(at(rows(*sides, confidence=0.2), wide), BOTH, 0.5, 1936)
    assert len(found) == len(sides)
    assert (np.diff(found[:, 4]) <= 0).all()
    assert set(map(tuple, found[:, :4])) == set(map(tuple, wide[:, :4]))


def test_widths_are_chosen_by_average_precision():
    """Both widths are needed if small rocks are found only in wide images and large rocks only in narrow images."""
    labels = [(np.array([0, 0]), rows(20, 300)[:, :4])]
    found = {512: [rows(20, 300)[1:]], 896: [rows(20, 300)[:1]]}
    assert choose_sizes(labels, found, 0.5, 1936).widths == [512, 896]
    assert choose_sizes(labels, {512: [rows(20, 300)], 896: [rows(5)]}, 0.5, 1936) == ClassInferenceWidths.same(
        InferenceWidths((512,))
    )


def test_chosen_gates_follow_the_width_of_the_photos():
    """Photos of twice the width with boxes of twice the size have the same gates."""
    chosen = []
    for scale in (1, 2):
        labels = [(np.array([0, 0]), scale * rows(20, 60)[:, :4])]
        by_width = {512: rows(20, 60)[1:], 896: np.vstack([rows(20, 60)[:1], rows(70, left=400, confidence=0.9)])}
        for found in by_width.values():
            found[:, :4] *= scale
        chosen.append(choose_sizes(labels, {at: [found] for at, found in by_width.items()}, 0.5, scale * 1936))
    assert chosen[0] == chosen[1]
    assert chosen[0].by_class[0].gates_px == (32.0,)


def test_each_class_has_separate_widths():
    """Rocks are found only in the wide image, shadows only in the narrow image."""
    labels = [(np.array([0, 1]), rows(300, 300)[:, :4])]
    rock, shadow = rows(300, 300)
    shadow[5] = 1
    wrong = rows(250, left=5000, confidence=0.9, kind=1)
    found = {512: [np.vstack([shadow])], 896: [np.vstack([rock, wrong])]}
    sizes = choose_sizes(labels, found, 0.5, 1936)
    assert sizes == ClassInferenceWidths((InferenceWidths((896,)), InferenceWidths((512,))))
    merged = merge({width: rows[0] for width, rows in found.items()}, sizes, 0.5, 1936)
    assert sorted(merged[:, 5]) == [0, 1]
    assert wrong[0, 0] not in merged[:, 0]


@pytest.mark.parametrize(
    "given", [{"widths": [512, 896]}, {"widths": [896, 512], "gates_px": [64]}, {"gates_px": [64]}, {"widths": [500]}]
)
def test_inconsistent_widths_and_gates_are_an_error(given):
    with pytest.raises(ValidationError):
        PredictionOptions.model_validate(given)


def test_images_are_not_upscaled():
    sizes = InferenceWidths((640, 1024, 1792), (128.0, 64.0))
    assert sizes.within(960) == InferenceWidths((640, 960), (128.0,))
    assert sizes.within(1024) == InferenceWidths((640, 1024), (128.0,))
    assert sizes.within(320) == InferenceWidths((320,))
    assert sizes.within(1920) == sizes
