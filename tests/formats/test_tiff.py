import numpy as np
import pytest
import tifffile
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from polarsim.errors import FormatError
from polarsim.formats.tiff import read_floats, write_floats


@given(arrays(np.float32, st.tuples(st.integers(1, 9), st.integers(1, 9))))
def test_floats_read_back_with_those_that_are_none(tmp_path_factory, values):
    path = tmp_path_factory.mktemp("tiff") / "a.tif"
    write_floats(path, values)
    np.testing.assert_array_equal(read_floats(path), values)
    before = path.read_bytes()
    write_floats(path, values)
    assert path.read_bytes() == before


def test_other_files_are_refused_in_one_line(tmp_path):
    path = tmp_path / "a.tif"
    for content in (b"", b"no picture", b"II*\0"):
        path.write_bytes(content)
        with pytest.raises(FormatError, match=f"^{path}: [^\n]*$"):
            read_floats(path)
    for pixels in (np.ones((4, 5), np.uint16), np.ones((4, 5, 3), np.float32)):
        tifffile.imwrite(path, pixels, photometric="minisblack")
        with pytest.raises(FormatError, match="32-bit floats"):
            read_floats(path)
    with pytest.raises(FormatError, match="no readable TIFF"):
        read_floats(tmp_path / "gone.tif")
