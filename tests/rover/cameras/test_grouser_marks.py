"""Marks of grousers: spacing, restriction to soil, and removal by a later wheel."""

import numpy as np
import pytest

from polarsim.rover.cameras.grouser_marks import GrouserMark, Tread, marks_of, stamp
from tests.rover.ruts import CELL, hills, tracks

TREAD = Tread(24, 0.25, 0.2, 0.006, 0.006)


@pytest.mark.parametrize("slip", [0.0, 0.3])
def test_spacing_of_prints_follows_rolling_and_slip(slip):
    time = np.linspace(0, 10, 1001)
    spin = 0.8 * time
    centres = np.stack([spin * 0.25 * (1 - slip), 0 * time, 0.25 + 0 * time], axis=1)
    quaternions = np.stack([np.cos(spin / 2), 0 * spin, np.sin(spin / 2), 0 * spin], axis=1)  # turning about y
    marks = marks_of(time, spin, centres, quaternions, np.ones(1001, bool), 24)
    assert marks_of(time, spin, centres, quaternions, np.zeros(1001, bool), 24) == []  # on rock
    gaps = np.diff([event.position[0] for event in marks])
    np.testing.assert_allclose(gaps, TREAD.spacing * (1 - slip), rtol=1e-6)
    np.testing.assert_allclose([event.ahead for event in marks], np.tile([1.0, 0], (len(marks), 1)), atol=1e-9)


def test_a_print_is_a_groove_across_the_rut_and_the_next_wheel_removes_it():
    own = tracks(hills(), finer=4)
    position = np.array([0.5, 1.2])
    stamp(own, [GrouserMark(0, position, np.array([-1.0, 0]))], TREAD)
    fine = CELL / 4
    row, column = np.rint((position[::-1] - [own.lattice.y0, own.lattice.x0]) / fine).astype(int)
    groove = own.marks[1:-1, 1:-1]
    np.testing.assert_allclose(groove[row, column], -TREAD.depth, rtol=0.02)
    assert groove[row + round(0.08 / fine), column] < -0.9 * TREAD.depth  # across
    assert abs(groove[row, column + round(0.03 / fine)]) < 1e-6  # along
    assert own.show(own.lattice.level)
    stamp(own, [GrouserMark(1, position + np.array([TREAD.spacing / 2, 0]), np.array([-1.0, 0]))], TREAD)
    assert abs(groove[row, column + 2]) < 0.01 * TREAD.depth  # was a quarter of the depth
