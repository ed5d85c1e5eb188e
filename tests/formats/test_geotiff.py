"""Elevation models: heights where the file says that they lie, and one line for whatever is none."""

import numpy as np
import pytest

from polarsim.errors import FormatError
from polarsim.formats.geotiff import read_elevation

rasterio = pytest.importorskip("rasterio", reason="rasterio is not installed")

MOON = "+proj=stere +lat_0=-90 +R=1737400 +units=m +no_defs"
WEST, NORTH, PIXEL = 1000.0, 5000.0, 2.0


def write(path, height, crs=MOON, **more):
    profile = {"transform": rasterio.Affine(PIXEL, 0, WEST, 0, -PIXEL, NORTH), "crs": crs, **more}
    shape = {"width": height.shape[1], "height": height.shape[0], "count": 1, "dtype": height.dtype}
    with rasterio.open(path, "w", driver="GTiff", **shape, **profile) as file:
        file.write(height, 1)
    return path


@pytest.fixture
def slope():
    """30 x 40 pixels that rise by 0.1 a metre to the east and 0.2 to the north, from 7 m in the south-west corner."""
    row, column = np.mgrid[:30, :40]
    return (7 + 0.1 * PIXEL * (column + 0.5) + 0.2 * PIXEL * (29.5 - row)).astype(np.float32)


def test_heights_lie_east_and_north_of_the_place_that_is_asked_for(tmp_path, slope):
    path = write(tmp_path / "a.tif", slope)
    found = read_elevation(path, 10.0, 14.0, (WEST + 41.0, NORTH - 27.0))
    x, y = np.meshgrid(found.x, found.y)
    np.testing.assert_allclose(found.height, 7 + 0.1 * (41.0 + x) + 0.2 * (33.0 + y), atol=1e-4)
    assert found.pixel_m == PIXEL
    for axis in (found.x, found.y):
        assert (np.diff(axis) == PIXEL).all()
        assert axis[0] < -14 < 14 < axis[-1]  # no more than a spline needs
        assert len(axis) < 24


def test_the_middle_is_the_place_where_none_is_named_and_far_ground_is_what_there_is(tmp_path, slope):
    found = read_elevation(write(tmp_path / "a.tif", slope), 20.0, 500.0)
    assert found.height.shape == slope.shape
    assert (found.x[0], found.x[-1], found.y[0], found.y[-1]) == (-39.0, 39.0, -29.0, 29.0)


def test_heights_have_the_files_scale_and_offset(tmp_path):
    path = write(tmp_path / "a.tif", np.full((20, 20), 40, np.int16))
    with rasterio.open(path, "r+") as file:
        file.scales, file.offsets = (0.5,), (-3.0,)
    np.testing.assert_allclose(read_elevation(path, 10.0, 10.0).height, 17.0)


@pytest.mark.parametrize(
    ("more", "reason"),
    [
        ({"crs": None}, "no coordinate reference system"),
        ({"crs": "+proj=longlat +R=1737400 +no_defs"}, "geographic, in degrees"),
        ({"crs": "EPSG:2277"}, "US survey foot.* metres were expected"),
        ({"transform": rasterio.Affine(PIXEL, 0.5, WEST, 0.5, -PIXEL, NORTH)}, "north was expected to be up"),
        ({"transform": rasterio.Affine(0.5, 0, WEST, 0, -0.5, NORTH)}, r"reach 7\.25 m .* 20 m were asked for"),
        ({"nodata": 7.1}, None),
    ],
)
def test_what_is_no_model_in_metres_is_refused_with_its_name(tmp_path, slope, more, reason):
    path = write(tmp_path / "a.tif", slope, **more)
    if reason is None:  # a value that no pixel has is no hole
        assert read_elevation(path, 20.0, 20.0).height.size
        return
    with pytest.raises(FormatError, match=rf"a\.tif: .*{reason}"):
        read_elevation(path, 20.0, 20.0)


@pytest.mark.parametrize(("value", "more"), [(-9999.0, {"nodata": -9999.0}), (-32768.0, {}), (np.nan, {})])
def test_holes_are_refused_with_the_first_ones_place(tmp_path, slope, value, more):
    slope[10:12, 20] = value
    path = write(tmp_path / "a.tif", slope, **more)
    place = rf"\({WEST + 20.5 * PIXEL:.2f}, {NORTH - 10.5 * PIXEL:.2f}\)"
    with pytest.raises(FormatError, match=rf"a\.tif: .*{place}"):
        read_elevation(path, 20.0, 100.0)


MARKS = (-9999, 9999, -32768, -32767, 99999, -99999, 32767, -3.4028234663852886e38, float("nan"), 1e20)


@pytest.mark.parametrize("base", [0.0, -4500.0, 3000.0])
@pytest.mark.parametrize("mark", MARKS)
@pytest.mark.parametrize("tagged", ["untagged", "side file"])
def test_marks_of_holes_are_never_heights(tmp_path, slope, base, mark, tagged):
    slope += base
    slope[10:13, 10:13] = mark
    path = write(tmp_path / "a.tif", slope)
    if tagged == "side file":
        band = f'<PAMRasterBand band="1"><NoDataValue>{mark:.20g}</NoDataValue></PAMRasterBand>'
        (tmp_path / "a.tif.aux.xml").write_text(f"<PAMDataset>{band}</PAMDataset>")
    with pytest.raises(FormatError, match=r"a\.tif"):
        read_elevation(path, 20.0, 30.0)


def test_a_place_beside_a_hole_is_read(tmp_path, slope):
    slope[:3, :3] = -9999
    assert read_elevation(write(tmp_path / "a.tif", slope), 8.0, 8.0).height.min() > 0


def test_radii_are_refused_by_name(tmp_path, slope):
    with pytest.raises(FormatError):
        read_elevation(write(tmp_path / "a.tif", slope.astype(float) + 1_737_400), 20.0, 30.0)


def test_steep_ground_is_no_hole(tmp_path):
    """A crater's wall of 60 degrees, 200 m high."""
    height = np.repeat(np.clip(np.arange(40) * PIXEL * np.tan(np.radians(60)) - 60, 0, 200)[None], 30, axis=0)
    assert np.ptp(read_elevation(write(tmp_path / "a.tif", height.astype(np.float32)), 20.0, 40.0).height) > 70


@pytest.mark.parametrize("crs", ['LOCAL_CS["site",UNIT["metre",1]]', 'ENGCRS["site",EDATUM["site"],CS[Cartesian,2],'
    'AXIS["east",east],AXIS["north",north],LENGTHUNIT["metre",1]]'])  # fmt: skip
def test_a_local_frame_in_metres_is_read(tmp_path, slope, crs):
    assert read_elevation(write(tmp_path / "a.tif", slope, crs), 20.0, 50.0).height.shape == slope.shape


def test_a_world_file_places_the_heights(tmp_path, slope):
    path = write(tmp_path / "a.tif", slope, transform=None)
    (tmp_path / "a.tfw").write_text(f"{PIXEL}\n0\n0\n{-PIXEL}\n{WEST + PIXEL / 2}\n{NORTH - PIXEL / 2}\n")
    found = read_elevation(path, 10.0, 14.0, (WEST + 41.0, NORTH - 27.0))
    x, y = np.meshgrid(found.x, found.y)
    np.testing.assert_allclose(found.height, 7 + 0.1 * (41.0 + x) + 0.2 * (33.0 + y), atol=1e-4)


def test_heights_in_another_unit_are_refused(tmp_path, slope):
    path = write(tmp_path / "a.tif", slope)
    with rasterio.open(path, "r+") as file:
        file.units = ("km",)
    with pytest.raises(FormatError, match=r"a\.tif"):
        read_elevation(path, 20.0, 20.0)


def test_no_geotiff_is_refused_in_one_line(tmp_path):
    (tmp_path / "a.tif").write_text("no picture")
    with pytest.raises(FormatError, match=r"a\.tif") as found:
        read_elevation(tmp_path / "a.tif", 1.0, 1.0)
    assert "\n" not in str(found.value)
    with pytest.raises(FormatError, match=r"none\.tif"):
        read_elevation(tmp_path / "none.tif", 1.0, 1.0)
