"""Class masks read back, and other files are errors."""

import numpy as np
import pytest

from polarsim.errors import FormatError
from polarsim.formats import png
from polarsim.run_files import class_masks
from polarsim.run_files.instances import BACKGROUND, GROUND, RELIEF_SHADOW, ROCK_IDS, SHADOW_IDS


def test_a_mask_reads_back(tmp_path):
    mask = np.array([[0, 1, 2, 255], [2, 2, 0, 0]], np.uint8)
    class_masks.write_class_mask(tmp_path / "a.png", mask)
    np.testing.assert_array_equal(class_masks.read_class_mask(tmp_path / "a.png"), mask)


@pytest.mark.parametrize(
    "pixels",
    [
        np.full((4, 4), 3, np.uint8),
        np.zeros((4, 4), np.uint16),
        np.zeros((4, 4, 3), np.uint8),
    ],
)
def test_other_images_are_errors(tmp_path, pixels):
    png.write_png(tmp_path / "a.png", pixels)
    with pytest.raises(FormatError, match=r"a\.png"):
        class_masks.read_class_mask(tmp_path / "a.png")


def test_ids_become_classes_and_unlabelled_objects_are_ignored():
    ids = np.array([[BACKGROUND, GROUND, RELIEF_SHADOW], [ROCK_IDS + 1, ROCK_IDS + 2, SHADOW_IDS + 1]], np.uint16)
    mask = class_masks.of_ids(ids, [ROCK_IDS + 1, SHADOW_IDS + 1])
    np.testing.assert_array_equal(mask, [[0, 0, 0], [1, 255, 2]])
    np.testing.assert_array_equal(class_masks.of_ids(np.zeros((1, 2), np.uint16), []), [[0, 0]])


def test_a_labelled_object_outside_the_image_has_no_effect():
    ids = np.array([[GROUND, ROCK_IDS + 1]], np.uint16)
    hidden = [ROCK_IDS + 1, ROCK_IDS + 7, SHADOW_IDS + 1]
    np.testing.assert_array_equal(class_masks.of_ids(ids, hidden), class_masks.of_ids(ids, [ROCK_IDS + 1]))
