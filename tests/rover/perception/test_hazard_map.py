"""Maps of rocks, as they are and as boxes tell."""

from polarsim.rover.cameras.suite import CameraSuite
from polarsim.rover.perception import hazard_map
from polarsim.rover.perception.measure import ride_of
from tests.rover import driven
from tests.rover.perception.boxes import CONFIDENCE, table


def test_the_true_map_has_the_rocks_where_they_stand():
    world = driven.world()
    grid = hazard_map.grid_over(world)
    true = hazard_map.true_map(world, grid)
    x, y, height, _ = driven.ROCKS[2]
    row, column = int((y - world.y[0]) / 0.15), int((x - world.x[0]) / 0.15)
    assert true.rock[row, column]
    assert 0.4 * height < true.height[row, column] <= height + 0.01
    touched = sum((2 * rock[3] / 0.15 + 1) ** 2 for rock in driven.ROCKS)  # cells of squares around the rocks
    assert 0.5 * touched < true.rock.sum() < touched
    assert true.looked.all()


def test_ground_is_looked_at_only_where_the_camera_passed(drive):
    folder, options = drive
    suite = CameraSuite(driven.trace(seconds=8.0), driven.vehicle(), options)
    grid = hazard_map.grid_over(suite.trace.world)
    nothing = table([])
    seen = hazard_map.mapped(nothing, ride_of(suite), grid, CONFIDENCE)
    assert 0.1 < seen.looked.mean() < 0.9
    assert not seen.looked[:, -3:].any()  # behind the start
    assert not seen.rock.any()
    assert folder.is_dir()
