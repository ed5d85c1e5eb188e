"""Runs compared with COCO's tool pycocotools."""

import hypothesis.extra.numpy as arrays
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pycocotools import mask as coco_mask

from polarsim.errors import FormatError
from polarsim.formats import rle

any_mask = arrays.arrays(bool, st.tuples(st.integers(1, 9), st.integers(1, 9)))


def of_coco(mask: np.ndarray) -> str:
    return coco_mask.encode(np.asfortranarray(mask.astype(np.uint8)))["counts"].decode()


@settings(deadline=None, max_examples=40)
@given(mask=any_mask)
def test_runs_equal_those_of_pycocotools(mask):
    assert rle.encode_rle(mask, size=mask.shape[::-1]).counts == of_coco(mask)


@settings(deadline=None, max_examples=40)
@given(mask=any_mask, left=st.integers(0, 1927), top=st.integers(0, 1207))
def test_a_part_of_a_photo_has_the_same_runs_as_the_photo(mask, left, top):
    whole = np.zeros((1216, 1936), bool)
    whole[top : top + mask.shape[0], left : left + mask.shape[1]] = mask
    assert rle.encode_rle(mask, whole.shape[::-1], left, top).counts == of_coco(whole)


@settings(deadline=None, max_examples=40)
@given(mask=any_mask)
def test_runs_of_pycocotools_decode_to_the_mask(mask):
    found = rle.from_text(of_coco(mask), mask.shape[::-1])
    np.testing.assert_array_equal(found.mask(), mask)
    assert found.area == mask.sum()


def test_long_runs_need_several_characters():
    mask = np.zeros((1216, 1936), bool)
    mask[:, 300:1700] = True
    found = rle.encode_rle(mask, mask.shape[::-1])
    assert found.counts == of_coco(mask)
    assert found.area == 1216 * 1400


def test_plain_lengths_are_compressed():
    # Two columns of three pixels: 1 empty, 4 full, 1 empty.
    found = rle.from_runs([1, 4, 1], (2, 3))
    np.testing.assert_array_equal(found.mask(), [[False, True], [True, True], [True, False]])


@pytest.mark.parametrize("runs", [[], [5], [7], [1, 6], [-1, 7], [2, -1, 5]])
def test_lengths_that_do_not_fill_the_image_are_errors(runs):
    with pytest.raises(FormatError):
        rle.from_runs(runs, (2, 3))
