import numpy as np
import pytest
import tifffile
from hypothesis import given, settings
from hypothesis import strategies as st

from polarsim.errors import FormatError
from polarsim.formats import nasa
from polarsim.formats.calibrations import read_calibration
from polarsim.geometry.lens import Lens
from polarsim.geometry.poses import Pose
from polarsim.geometry.stereo import StereoRig, rectified_left
from polarsim.site import polar

TERRAIN_11 = """\
made by a program
CAMERA_MATRIX_LEFT: 2068.44 0 964.405 0 2064.29 593.512 0 0 1
DISTORTION_COEFFICIENTS_LEFT: -0.108441 0.158389 0.000537106 -0.00127904
CAMERA_MATRIX_RIGHT: 2065.6 0 952.098 0 2061.9 606.559 0 0 1
DISTORTION_COEFFICIENTS_RIGHT: -0.114041 0.178219 -0.000146877 -0.00112736
ROTATION_MATRIX: 0.999997 0.00172602 0.0019164 -0.00172807 0.999998 0.00106908 -0.00191455 -0.00107239 0.999998
TRANSLATION_VECTOR: -0.301556 0.000599 0.001489
"""  # NASA's file of terrain 11
SIZE = (12, 8)  # width and height of the little range maps here


def read(path):
    return read_calibration(path, polar())


@pytest.fixture
def calibration(tmp_path):
    def write(text):
        path = tmp_path / "stereo.calibration"
        path.write_text(text)
        return path

    return write


def test_rectifying_the_real_calibration_gives_the_matrix_of_the_real_range_maps(calibration):
    lens = rectified_left(read(calibration(TERRAIN_11))).lens
    # Current OpenCV; NASA's maps were made with 1991.49, 966.256, 600.347 by an older one. Their pixels start at -0.5.
    assert lens.fx == pytest.approx(1990.6, abs=0.1)
    assert lens.cx - 0.5 == pytest.approx(966.2, abs=0.1)
    assert lens.cy - 0.5 == pytest.approx(600.1, abs=0.1)


def test_order_unknown_keys_and_other_lines_do_not_matter(calibration):
    shuffled = "\n".join([*reversed(TERRAIN_11.splitlines()), "SOME_OTHER_KEY: 1 2 3", "", "no colon here"])
    assert read(calibration(shuffled)).right == read(calibration(TERRAIN_11)).right


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("TRANSLATION_VECTOR: -0.301556 0.000599 0.001489", ""),
        ("0.000599 0.001489", "0.000599"),
        ("-0.301556", "-301.556"),
        ("ROTATION_MATRIX: 0.999997", "ROTATION_MATRIX: 0.9"),
        ("0.158389", "abc"),
        ("0.158389", "nan"),
        ("2065.6 0", "2065.6 7"),
        ("-0.00112736", "-0.00112736 0 0.1 0 0"),
        ("-0.00112736", f"-0.00112736 0{' 0' * 8} 0.1"),
        ("-0.301556", "0.301556"),
        ("-0.301556 0.000599", "-0.000599 0.301556"),
        ("ROTATION_MATRIX:", "TRANSLATION_VECTOR: -0.3 0 0\nROTATION_MATRIX:"),
        ("2068.44 0 964.405 0 2064.29 593.512", "1034.22 0 482.2 0 1032.1 296.8"),
    ],
)
def test_an_invalid_calibration_is_an_error_with_file_and_reason(calibration, old, new):
    path = calibration(TERRAIN_11.replace(old, new))
    with pytest.raises(FormatError) as caught:
        read(path)
    assert str(path) in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("zeros", [3, 7, 9])
def test_zero_distortion_terms_of_other_models_are_accepted(calibration, zeros):
    terms = f"-0.00112736 0.02{' 0' * zeros}"
    rig = read(calibration(TERRAIN_11.replace("-0.00112736", terms)))
    assert rig.right.distortion[4] == 0.02


numbers = st.floats(-0.2, 0.2)


@settings(max_examples=25)
@given(
    focal=st.floats(1500, 2500), centre=st.tuples(st.floats(900, 1000), st.floats(550, 650)),
    terms=st.tuples(numbers, numbers, numbers, numbers, numbers), rotvec=st.tuples(numbers, numbers, numbers),
)  # fmt: skip
def test_a_calibration_reads_back(tmp_path_factory, focal, centre, terms, rotvec):
    lens = Lens(focal, focal * 0.99, *centre, terms, width=1936, height=1216)
    rig = StereoRig(
        lens,
        Lens(focal + 1, focal, *centre, width=1936, height=1216),
        Pose.from_rotvec(np.array(rotvec), np.array([0.3, 0.01, 0.0])),
    )
    path = tmp_path_factory.mktemp("calibration") / "stereo.calibration"
    nasa.write_calibration(path, rig)
    again = read(path)
    points = np.array([[0.4, 0.2, 1.0], [-0.4, -0.3, 1.0]])
    np.testing.assert_allclose(again.left.project(points), lens.project(points), atol=0.01)  # six digits, px
    np.testing.assert_allclose(again.left_from_right.matrix, rig.left_from_right.matrix, atol=3e-6)


def points_with_gaps(rng):
    points = rng.uniform(1, 7, (SIZE[1], SIZE[0], 3)).astype(np.float32)
    points[2, 3] = np.nan
    return points


def test_a_range_map_reads_back(tmp_path, rng):
    points = points_with_gaps(rng)
    nasa.write_range_map(tmp_path / "map.tif", points)
    np.testing.assert_allclose(nasa.read_range_map(tmp_path / "map.tif", SIZE), points, rtol=1e-6)
    stored = tifffile.imread(tmp_path / "map.tif")
    assert stored.dtype == np.float32
    assert (stored[2, 3] == 0).all()
    assert stored[0, 0, 2] == pytest.approx(1000 * points[0, 0, 2], rel=1e-6)  # millimetres in the file


def test_a_range_map_with_bands_first_and_a_fourth_band_is_read_the_same(tmp_path, rng):
    points = points_with_gaps(rng)
    bands = np.moveaxis(np.nan_to_num(points * 1000), -1, 0)
    tifffile.imwrite(tmp_path / "planes.tif", np.concatenate([bands, bands[:1]]), photometric="minisblack")
    np.testing.assert_allclose(nasa.read_range_map(tmp_path / "planes.tif", SIZE), points, rtol=1e-6)


@pytest.mark.parametrize(
    "stored",
    [
        np.ones((8, 12), np.float32),
        np.ones((8, 12, 2), np.float32),
        np.ones((9, 12, 3), np.float32),
        np.zeros((8, 12, 3), np.float32),
        np.full((8, 12, 3), np.nan, np.float32),
        np.ones((8, 12, 3), np.complex64),
    ],
)
def test_a_tiff_that_is_no_range_map_is_an_error(tmp_path, stored):
    tifffile.imwrite(tmp_path / "map.tif", stored, photometric="minisblack")
    with pytest.raises(FormatError):
        nasa.read_range_map(tmp_path / "map.tif", SIZE)


def test_a_huge_declared_size_is_an_error_before_pixels_are_read(tmp_path, rng):
    nasa.write_range_map(tmp_path / "map.tif", points_with_gaps(rng))
    data = bytearray((tmp_path / "map.tif").read_bytes())
    with tifffile.TiffFile(tmp_path / "map.tif") as tiff:
        tags = tiff.pages[0].tags
        for name in ("ImageWidth", "ImageLength"):
            offset = tags[name].valueoffset
            data[offset : offset + 2] = (60000).to_bytes(2, "little")
    (tmp_path / "map.tif").write_bytes(data)
    with pytest.raises(FormatError):
        nasa.read_range_map(tmp_path / "map.tif", SIZE)


def range_map(path, marks, kind="float32", tag=None, factor=1.0):
    """A wall at 3 m, 16 x 12 pixels, millimetres, with a no-data value in the first 20 pixels."""
    import tifffile

    row, column = np.mgrid[:12, :16]
    bands = np.dstack([column * 100.0 - 800, row * 100.0 - 600, np.full((12, 16), 3000.0)]) * factor
    bands.reshape(-1, 3)[:20] = marks
    tags = [] if tag is None else [(42113, "s", 0, tag, True)]
    tifffile.imwrite(path, bands.astype(kind), photometric="minisblack", planarconfig="contig", extratags=tags)
    return path


@pytest.mark.parametrize("kind", ["float32", "float64", "int32"])
@pytest.mark.parametrize("mark", [0, -9999, 9999, 99999, -32768, 32767, 1e6])
def test_no_data_values_are_not_points(tmp_path, mark, kind):
    for number, path in enumerate(
        (
            range_map(tmp_path / "untagged.tif", [mark] * 3, kind),
            range_map(tmp_path / "tagged.tif", [mark] * 3, kind, f"{mark:g}"),
            range_map(tmp_path / "one_band.tif", [5, 7, mark], kind, f"{mark:.1f}\0"),
        )
    ):
        points = nasa.read_range_map(path, (16, 12))
        assert int(np.isnan(points).all(axis=-1).sum()) == 20, (path, number)
        assert np.nanmax(points[..., 2]) == pytest.approx(3)


@pytest.mark.parametrize("factor", [0.001, 1000])
def test_a_range_map_in_another_unit_is_an_error(tmp_path, factor):
    with pytest.raises(FormatError):
        nasa.read_range_map(range_map(tmp_path / "a.tif", 0, factor=factor), (16, 12))


@pytest.mark.parametrize("compression", ["lzw", "zstd", "lerc"])
def test_a_compression_that_needs_a_package_is_named(tmp_path, compression):
    rasterio = pytest.importorskip("rasterio")
    profile = {"width": 16, "height": 12, "count": 3, "dtype": "float32", "compress": compression}
    with rasterio.open(tmp_path / "a.tif", "w", driver="GTiff", **profile) as file:
        file.write(np.full((3, 12, 16), 3000, np.float32))
    with pytest.raises(FormatError, match=r"a\.tif"):
        nasa.read_range_map(tmp_path / "a.tif", (16, 12))
