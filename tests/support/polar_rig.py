"""The rig of NASA's POLAR data set, as calibrated for terrain 11."""

from __future__ import annotations

from polarsim.formats.calibrations import stated_rig
from polarsim.geometry.stereo import StereoRig
from polarsim.site import polar


def default_rig() -> StereoRig:
    """Return the rig of terrains without a calibration file."""
    return stated_rig(polar())
