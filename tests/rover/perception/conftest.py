import pytest

from polarsim.rover.cameras.frames import render_frames
from polarsim.rover.cameras.options import CameraSuiteOptions
from polarsim.rover.drive.trace import write_trace
from polarsim.rover.vehicle.mounts import FRONT
from tests.rover import driven
from tests.rover.perception.boxes import OPTIONS


@pytest.fixture(scope="session")
def drive(tmp_path_factory):
    folder = tmp_path_factory.mktemp("seed3")
    write_trace(folder, driven.trace(seconds=8.0))
    options = CameraSuiteOptions(
        views=(FRONT,), suns=("1", "2"), models=("hapke",), exposures_ms=(256,), scale=0.2, finer=1, far_m=5.0,
        every=4, onboard=OPTIONS,
    )  # fmt: skip
    render_frames(folder, driven.vehicle(), options, 3)
    return folder, options
