"""Selection of samples near walls."""

from dataclasses import replace

import numpy as np
import pytest

from polarsim.render.fitting.samples import clear_of_walls
from polarsim.run_files.walls import Walls, level_walls


@pytest.mark.parametrize(("nominal", "used"), [(False, [False, True, True]), (True, [False, False, True])])
def test_sand_next_to_a_wall_that_no_scan_shows_is_not_used(nominal, used):
    sides = {side: replace(wall, support=0.9) for side, wall in level_walls(2.0, 0.3).sides.items()}
    sides |= {"+x": replace(sides["+x"], support=0.0)} if nominal else {}
    points = np.array([[1.98, 0.0, 0.0], [1.90, 0.0, 0.0], [1.80, 0.0, 0.0]])
    found = clear_of_walls(points, np.array([0.0, 0.0, 3.0]), Walls(sides, "scans"))
    assert found.tolist() == used
