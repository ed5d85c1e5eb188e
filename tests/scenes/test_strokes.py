"""Detection and removal of strokes without traces that depend on rocks."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import ndimage

from polarsim.formats import png, release
from polarsim.scenes.strokes import (
    COLOURS,
    augment_with_annotations,
    draw_strokes,
    erase_strokes,
    find_drawn_boxes,
    find_strokes,
)

BOXES = np.array([[40.0, 30, 110, 90], [150, 60, 190, 120]])


def grainy(random: np.random.Generator, shape: tuple[int, int] = (160, 240)) -> np.ndarray:
    smooth = ndimage.gaussian_filter(random.standard_normal(shape), 6) * 300
    return np.clip(90 + smooth + random.normal(0, 2, shape), 0, 255).astype(np.uint8)


def test_a_grey_image_has_no_strokes_and_is_unchanged(rng):
    photo = grainy(rng)
    assert not find_strokes(np.repeat(photo[..., None], 3, axis=-1)).any()
    np.testing.assert_array_equal(erase_strokes(np.repeat(photo[..., None], 3, axis=-1)), photo)
    np.testing.assert_array_equal(augment_with_annotations(photo, 0, rng, 480), photo)


@pytest.mark.parametrize("colour", COLOURS)
def test_only_strokes_are_changed_and_recover_the_photo_to_a_few_grey_values(rng, colour):
    photo = grainy(rng)
    drawn = draw_strokes(photo, BOXES, [3, 17], colour, 3, 20)
    strokes, erased = find_strokes(drawn), erase_strokes(drawn)
    np.testing.assert_array_equal(erased[~strokes], photo[~strokes])
    error = erased[strokes].astype(float) - photo[strokes]
    assert np.abs(error).mean() < 6  # the photo has a standard deviation of about 12, of which 2 are grain
    assert abs(error.mean()) < 1.5


def test_the_grey_value_at_an_antialiased_edge_is_recovered():
    photo = np.full((40, 40), 100, np.uint8)
    picture = np.repeat(photo[..., None], 3, axis=-1)
    picture[10:30, 20] = (255, 0, 0)
    picture[10:30, 21] = (162, 60, 60)  # four tenths of red over 100
    np.testing.assert_allclose(erase_strokes(picture), 100, atol=1)


@settings(max_examples=25, deadline=None)
@given(
    x=st.integers(20, 100), y=st.integers(40, 80), wide=st.integers(30, 100), high=st.integers(30, 60),
    width=st.sampled_from([1, 3]),
)  # fmt: skip
def test_drawn_boxes_are_detected(x, y, wide, high, width):
    photo = np.full((160, 240), 80, np.uint8)
    drawn = draw_strokes(photo, np.array([[x, y, x + wide, y + high]]), [7], COLOURS[0], width, 12)
    inner = [box for box in find_drawn_boxes(find_strokes(drawn)) if box[2] - box[0] > wide / 2]
    half = (width + 1) / 2
    np.testing.assert_allclose(inner, [[x + half, y + half, x + wide - half + 1, y + high - half + 1]], atol=1)


def test_random_strokes_are_independent_of_labels(rng):
    """Compare the shares of changed pixels inside and outside of labels over many images of flat grain."""
    labelled = np.zeros((160, 240), bool)
    labelled[50:110, 60:130] = True
    inside, outside = [], []
    for _ in range(80):
        photo = rng.integers(60, 120, labelled.shape).astype(np.uint8)
        touched = augment_with_annotations(photo, 12, rng, 480) != photo
        inside.append(touched[labelled].mean())
        outside.append(touched[~labelled].mean())
    difference = np.array(inside) - np.array(outside)
    # The centre has slightly more strokes than the border, where boxes extend outside the image.
    assert np.mean(inside) > 0.005
    assert abs(difference.mean()) < 0.25 * np.mean(outside) + 3 * difference.std() / np.sqrt(len(difference))


def test_erased_strokes_have_the_grain_of_the_photo(rng):
    """A smooth stripe would mark the annotated boxes for a detector."""
    photo = (100 + ndimage.gaussian_filter(rng.normal(0, 6, (300, 400)), 0.7)).astype(np.uint8)
    drawn = draw_strokes(photo, np.array([[60.0, 60, 340, 240]]), [1], COLOURS[0], 4, 26)
    strokes, erased = find_strokes(drawn), erase_strokes(drawn).astype(float)
    fine = np.abs(erased - ndimage.gaussian_filter(erased, 1.5))
    assert 0.5 < fine[strokes].mean() / fine[~strokes].mean() < 1.5


@pytest.mark.parametrize(("terrain", "position", "boxes"), [(1, "A", 15), (1, "C", 15), (11, "C", 9), (4, "C", 0)])
def test_the_number_of_boxes_on_published_covers(release_root, terrain, position, boxes):
    picture = png.read_png(release.cover_photos(release_root, terrain)[position])[..., :3]
    assert len(find_drawn_boxes(find_strokes(picture))) == boxes  # counted by eye
