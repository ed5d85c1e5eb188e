"""World from an elevation model: heights, surroundings of the grid, rocks with and without labels."""

import numpy as np
import pytest

from polarsim.errors import FormatError, RoverError
from polarsim.rover.world import dem as module
from polarsim.rover.world.dem import dem_world
from polarsim.rover.world.options import DemOptions, WorldOptions
from polarsim.rover.world.stitch import TerrainSolids, rough_world
from polarsim.rover.world.surface import World, read_world, write_world
from tests.rover.made_world import ball, plane

PATH = np.array([[2.0, 0.0], [-2.0, 0.0]])
TERRAINS = [TerrainSolids(4, plane(0.0), {7: ball(0, 0, 0), 8: ball(0.4, 0, 0, 0.05)})]
BARE = {"craters": 0.0, "relief_m": 0.0, "rocks": 0.0}


def options(**dem):
    dem = {"size_m": 16.0, "horizon_m": 40.0, "drive_m": 4.0, "rocks": 0.05, **dem}
    return WorldOptions(terrains=(4,), width_m=3.0, margin_m=1.0, cell_m=0.05, dem=DemOptions(**dem))


@pytest.fixture(scope="module")
def world() -> World:
    return dem_world(options(), TERRAINS, PATH)


@pytest.fixture
def hill(tmp_path):
    """A GeoTIFF of 100 x 100 m that rises by 0.1 per metre to the east, with a hill 30 m north of the centre."""
    rasterio = pytest.importorskip("rasterio", reason="rasterio is not installed")
    x, y = np.meshgrid(np.arange(-49.5, 50), np.arange(49.5, -50, -1))
    height = 1200 + 0.1 * x + 8 * np.exp(-(x**2 + (y - 30) ** 2) / 50)
    place = {"crs": "+proj=stere +lat_0=-90 +R=1737400 +units=m", "transform": rasterio.Affine(1, 0, 500, 0, -1, 900)}
    shape = {"width": 100, "height": 100, "count": 1, "dtype": "float32"}
    with rasterio.open(tmp_path / "hill.tif", "w", driver="GTiff", **shape, **place) as file:
        file.write(height.astype(np.float32), 1)
    return tmp_path / "hill.tif"


def test_the_ground_is_that_of_the_model_up_to_the_horizon(hill):
    world = dem_world(options(path=hill, **BARE), TERRAINS, PATH)
    assert (world.x[0], world.x[-1], world.y[0], world.y[-1]) == pytest.approx((-3.0, 3.0, -1.5, 1.5))
    np.testing.assert_allclose(world.level, np.broadcast_to(0.1 * world.x, world.level.shape), atol=1e-3)
    assert float(world.height_at(0.0, 30.0)) == pytest.approx(8.0, abs=0.3)
    np.testing.assert_allclose(world.height_at(np.array([-6.0, 12.0]), np.zeros(2)), [-0.6, 1.2], atol=0.01)
    assert min(-world.around.x[0], world.around.x[-1], -world.around.y[0], world.around.y[-1]) >= 40.0


def test_the_distance_of_nodes_grows_outside_the_grid():
    around = dem_world(options(**BARE), TERRAINS, PATH).around
    for nodes, half in ((around.x, 3.0), (around.y, 1.5)):
        step = np.diff(nodes)
        middle = (nodes[1:] + nodes[:-1]) / 2
        np.testing.assert_allclose(step[np.abs(middle) < half], 0.05)
        assert (step[1:] / step[:-1]).max() < 1.11
        assert step[np.abs(middle) < 8.0].max() <= 0.25
        assert step.max() > 1.0


def test_equal_options_give_equal_worlds_and_seeds_differ(world, tmp_path):
    again, second = dem_world(options(), TERRAINS, PATH), dem_world(options(seed=1, rocks=0), TERRAINS, PATH)
    np.testing.assert_array_equal(world.level, again.level)
    np.testing.assert_array_equal(world.vertices, again.vertices)
    assert (world.level != second.level).any()
    write_world(tmp_path / "a", world)
    write_world(tmp_path / "b", read_world(tmp_path / "a"))
    for name in ("ground.npz", "rocks.npz", "rocks.parquet"):
        assert (tmp_path / "a" / name).read_bytes() == (tmp_path / "b" / name).read_bytes()


def test_rocks_are_on_the_ground_and_not_at_the_start(world):
    assert len(world.rocks) > 50
    for row in world.rocks.sample(10, random_state=0).to_dict("records"):
        points = world.rock_mesh(int(row["rock"]))[0]
        ground = float(world.height_at(row["x_m"], row["y_m"]))
        assert abs(points[:, 2].min() + 0.5 * row["width_m"] - ground) < 0.1 * row["width_m"] + 0.03
        assert row["height_m"] == pytest.approx(0.5 * row["width_m"], abs=0.1 * row["width_m"] + 0.03)
    assert np.hypot(world.rocks["x_m"] - 2.0, world.rocks["y_m"]).min() > 1.5
    near = world.rocks_on_grid
    assert 0 < len(near) < len(world.rocks)
    assert (near["x_m"].abs() < 3.0 + near["radius_m"]).all()


def test_rocks_without_labels_are_part_of_the_surroundings_and_coarser(world, monkeypatch):
    every = world
    monkeypatch.setattr(module, "_MOST_ROCKS", len(every.rocks_on_grid) + 5)
    few = dem_world(options(), TERRAINS, PATH)
    assert len(few.rocks) == len(every.rocks_on_grid) + 5
    np.testing.assert_array_equal(few.rocks_on_grid["x_m"], every.rocks_on_grid["x_m"])
    assert len(every.around.triangles) == 0
    assert len(few.around.triangles) > 0
    assert few.rocks["width_m"].sum() < every.rocks["width_m"].sum()
    assert len(few.rocks[~few.rocks["x_m"].isin(every.rocks["x_m"])]) == 0


def test_drives_share_the_world_except_for_noise(world):
    first, again, second = (rough_world(world, 0.001, seed) for seed in (1, 1, 2))
    np.testing.assert_array_equal(first.level, again.level)
    assert (first.level - world.level).std() == pytest.approx(0.001, rel=0.1)
    assert (first.level != second.level).any()
    assert (first.around.level != second.around.level).any()
    assert np.abs(first.around.level - world.around.level).max() < 0.01


def test_a_path_out_of_the_square_is_an_error():
    with pytest.raises(RoverError, match=r"rover\.world\.dem"):
        dem_world(options(), TERRAINS, np.array([[2.0, 0.0], [-9.0, 0.0]]))


def test_a_model_smaller_than_the_square_is_an_error_with_its_path(hill):
    with pytest.raises(FormatError, match=r"hill\.tif"):
        dem_world(options(path=hill, size_m=120.0), TERRAINS, PATH)
