"""Suns of a drive: the four of the paper, and the real Sun."""

from datetime import UTC, datetime

import numpy as np
import pytest

from polarsim.errors import RoverError
from polarsim.render.views.moon import sun_over
from polarsim.rover.cameras.lights import suns_of
from polarsim.rover.cameras.options import CameraSuiteOptions, RealSun


def test_the_papers_suns_are_in_the_east_southeast_southwest_and_west():
    suns = suns_of(CameraSuiteOptions())
    assert [round(sun.azimuth_deg) for sun in suns.values()] == [0, 315, 225, 180]
    east, southeast = (suns[name].lamp.position for name in "12")
    assert east[0] > 0
    assert abs(east[1]) < 1e-9 * east[0]
    assert southeast[0] > 0 > southeast[1]
    np.testing.assert_allclose(np.degrees(np.arcsin(east[2] / np.linalg.norm(east))), 8)


def real_sun(day):
    return RealSun(latitude_deg=-85.4, longitude_deg=31, moment_utc=datetime(2026, 12, day, tzinfo=UTC))


def test_the_real_sun_near_the_pole_is_low_and_has_the_direction_of_the_ephemeris():
    sun = suns_of(CameraSuiteOptions(suns=(), real_sun=real_sun(21)))["real"]
    assert 5 < sun.elevation_deg < 6.3  # never above 6.2 at that latitude
    compass, elevation = sun_over(-85.4, 31, datetime(2026, 12, 21, tzinfo=UTC))
    towards = sun.lamp.position / np.linalg.norm(sun.lamp.position)
    np.testing.assert_allclose(np.degrees(np.arctan2(towards[0], towards[1])) % 360, compass, atol=1e-6)  # from north
    np.testing.assert_allclose(np.degrees(np.arcsin(towards[2])), elevation, atol=1e-6)


@pytest.mark.parametrize(("real", "message"), [(real_sun(6), "2026-12-06"), (None, r"rover\.cameras")])
def test_a_real_sun_below_the_horizon_and_no_sun_are_errors(real, message):
    with pytest.raises(RoverError, match=message):
        suns_of(CameraSuiteOptions(suns=(), real_sun=real))
