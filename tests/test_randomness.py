"""Random numbers and digests depend on values, not on the sign of a zero."""

import json
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from polarsim.config import parse_config
from polarsim.formats.yaml_files import read_yaml
from polarsim.randomness import generator, without_negative_zeros

CONFIG = Path(__file__).parent.parent / "config/config.yaml"

VALUES = st.recursive(
    st.sampled_from([0.0, -0.0, 1.5, -2.5, 3, "-0.0", None, True]),
    lambda inner: st.lists(inner, max_size=3) | st.tuples(inner, inner) | st.dictionaries(st.text("ab"), inner),
    max_leaves=8,
)


def flipped(value):
    """Return the value with the opposite sign of each zero."""
    if isinstance(value, float):
        return -value if value == 0 else value
    if isinstance(value, dict):
        return {key: flipped(one) for key, one in value.items()}
    return type(value)(flipped(one) for one in value) if isinstance(value, list | tuple) else value


@given(purpose=VALUES)
def test_the_sign_of_a_zero_changes_no_random_number(purpose):
    assert generator(7, "test", flipped(purpose)).random() == generator(7, "test", purpose).random()
    assert json.dumps(without_negative_zeros(flipped(purpose))) == json.dumps(without_negative_zeros(purpose))
    assert without_negative_zeros(purpose) == purpose


@pytest.mark.parametrize("kind", ["<f4", ">f4", "<f8", "<f2", "<c16"])
def test_arrays_keep_their_type_and_values(kind):
    array = np.array([[0.0, -0.0], [-1.5, 2.0]], kind)[:, ::-1]
    found = without_negative_zeros(array)
    assert found.tobytes() == without_negative_zeros(-1 * -array).tobytes()
    assert found.dtype == array.dtype.newbyteorder("=")
    np.testing.assert_array_equal(found, array)
    assert not np.signbit(found.real[0]).any()


def test_numbers_of_other_purposes_stay_as_they_were():
    """Return the number of the version without `without_negative_zeros`."""
    assert generator(1, "sensor", "01_A_off_30_L_0256", 2.5, [0.5, 1]).integers(2**32) == 3911179663


def test_the_digest_of_a_configuration_does_not_depend_on_the_sign_of_zero():
    content = read_yaml(CONFIG)
    digests = {parse_config({**content, "render": {"bounce": zero}}).digest() for zero in (0.0, -0.0)}
    assert len(digests) == 1
