"""What a detector finds on board."""

import pytest

from polarsim.errors import RoverError
from polarsim.rover.onboard.detections import detect_drive
from tests.rover import driven


def test_no_detector_is_refused(drive):
    folder, options = drive
    with pytest.raises(RoverError, match="no weights"):
        detect_drive(folder, driven.vehicle(), options, 3)
