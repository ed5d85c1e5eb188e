"""Elevation models: positions of heights, and one-line errors for other files."""

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


def test_heights_are_relative_to_the_given_point(tmp_path, slope):
    path = write(tmp_path / "a.tif", slope)
    elevation = read_elevation(path, 10.0, 14.0, (WEST + 41.0, NORTH - 27.0))
    x, y = np.meshgrid(elevation.x, elevation.y)
    np.testing.assert_allclose(elevation.height, 7 + 0.1 * (41.0 + x) + 0.2 * (33.0 + y), atol=1e-4)
    assert elevation.pixel_m == PIXEL
    for axis in (elevation.x, elevation.y):
        assert (np.diff(axis) == PIXEL).all()
        assert axis[0] < -14 < 14 < axis[-1]  # with the margin of a spline
        assert len(axis) < 24


def test_the_default_point_is_the_centre_and_distant_heights_are_limited_by_the_file(tmp_path, slope):
    elevation = read_elevation(write(tmp_path / "a.tif", slope), 20.0, 500.0)
    assert elevation.height.shape == slope.shape
    assert (elevation.x[0], elevation.x[-1], elevation.y[0], elevation.y[-1]) == (-39.0, 39.0, -29.0, 29.0)


def test_scale_and_offset_of_the_file_are_applied(tmp_path):
    path = write(tmp_path / "a.tif", np.full((20, 20), 40, np.int16))
    with rasterio.open(path, "r+") as file:
        file.scales, file.offsets = (0.5,), (-3.0,)
    np.testing.assert_allclose(read_elevation(path, 10.0, 10.0).height, 17.0)


@pytest.mark.parametrize(
    ("more", "reason"),
    [
        ({"crs": None}, "coordinate reference system"),
        ({"crs": "+proj=longlat +R=1737400 +no_defs"}, "degrees"),
        ({"crs": "EPSG:2277"}, "US survey foot"),
        ({"transform": rasterio.Affine(PIXEL, 0.5, WEST, 0.5, -PIXEL, NORTH)}, "north"),
        ({"transform": rasterio.Affine(0.5, 0, WEST, 0, -0.5, NORTH)}, r"7\.25 m .* 20 m"),
    ],
)
def test_a_file_that_is_no_elevation_model_in_metres_is_an_error(tmp_path, slope, more, reason):
    path = write(tmp_path / "a.tif", slope, **more)
    with pytest.raises(FormatError, match=rf"a\.tif: .*{reason}"):
        read_elevation(path, 20.0, 20.0)


@pytest.mark.parametrize(("value", "more"), [(-9999.0, {"nodata": -9999.0}), (-32768.0, {}), (np.nan, {})])
def test_holes_are_errors_with_the_location_of_the_first_hole(tmp_path, slope, value, more):
    slope[10:12, 20] = value
    path = write(tmp_path / "a.tif", slope, **more)
    place = rf"\({WEST + 20.5 * PIXEL:.2f}, {NORTH - 10.5 * PIXEL:.2f}\)"
    with pytest.raises(FormatError, match=rf"a\.tif: .*{place}"):
        read_elevation(path, 20.0, 100.0)


NO_DATA = (-9999, 9999, -32768, -32767, 99999, -99999, 32767, -3.4028234663852886e38, float("nan"), 1e20)


@pytest.mark.parametrize("base", [0.0, -4500.0, 3000.0])
@pytest.mark.parametrize("tagged", ["untagged", "side file"])
def test_no_data_values_are_never_heights(tmp_path, slope, base, tagged):
    for value in NO_DATA:
        height = slope + base
        height[10:13, 10:13] = value
        path = write(tmp_path / "a.tif", height.astype(np.float32))
        if tagged == "side file":
            band = f'<PAMRasterBand band="1"><NoDataValue>{value:.20g}</NoDataValue></PAMRasterBand>'
            (tmp_path / "a.tif.aux.xml").write_text(f"<PAMDataset>{band}</PAMDataset>")
        with pytest.raises(FormatError, match=r"a\.tif"):
            read_elevation(path, 20.0, 30.0)


def test_a_part_without_the_hole_of_the_file_is_read(tmp_path, slope):
    slope[:3, :3] = -9999
    assert read_elevation(write(tmp_path / "a.tif", slope), 8.0, 8.0).height.min() > 0


def test_radii_are_errors(tmp_path, slope):
    with pytest.raises(FormatError):
        read_elevation(write(tmp_path / "a.tif", slope.astype(float) + 1_737_400), 20.0, 30.0)


def test_steep_ground_is_no_hole(tmp_path):
    """A crater wall of 60 degrees, 200 m high, is read."""
    height = np.repeat(np.clip(np.arange(40) * PIXEL * np.tan(np.radians(60)) - 60, 0, 200)[None], 30, axis=0)
    assert np.ptp(read_elevation(write(tmp_path / "a.tif", height.astype(np.float32)), 20.0, 40.0).height) > 70


@pytest.mark.parametrize("crs", ['LOCAL_CS["site",UNIT["metre",1]]', 'ENGCRS["site",EDATUM["site"],CS[Cartesian,2],'
    'AXIS["east",east],AXIS["north",north],LENGTHUNIT["metre",1]]'])  # fmt: skip
def test_a_local_frame_in_metres_is_read(tmp_path, slope, crs):
    assert read_elevation(write(tmp_path / "a.tif", slope, crs), 20.0, 50.0).height.shape == slope.shape


def test_a_world_file_sets_the_position_of_the_heights(tmp_path, slope):
    path = write(tmp_path / "a.tif", slope, transform=None)
    (tmp_path / "a.tfw").write_text(f"{PIXEL}\n0\n0\n{-PIXEL}\n{WEST + PIXEL / 2}\n{NORTH - PIXEL / 2}\n")
    elevation = read_elevation(path, 10.0, 14.0, (WEST + 41.0, NORTH - 27.0))
    x, y = np.meshgrid(elevation.x, elevation.y)
    np.testing.assert_allclose(elevation.height, 7 + 0.1 * (41.0 + x) + 0.2 * (33.0 + y), atol=1e-4)


def test_heights_in_kilometres_are_errors(tmp_path, slope):
    path = write(tmp_path / "a.tif", slope)
    with rasterio.open(path, "r+") as file:
        file.units = ("km",)
    with pytest.raises(FormatError, match=r"a\.tif"):
        read_elevation(path, 20.0, 20.0)
