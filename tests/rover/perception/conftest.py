import pytest

from polarsim.rover.cameras.frames import render_frames
from polarsim.rover.cameras.options import CameraSuiteOptions
from polarsim.rover.drive.trace import write_trace
from polarsim.rover.vehicle.camera_names import FRONT
from tests.rover import driven


@pytest.fixture(scope="session")
def drive(tmp_path_factory):
    folder = tmp_path_factory.mktemp("seed3")
    write_trace(folder, driven.trace(seconds=8.0))
    options = CameraSuiteOptions(
        views=(FRONT,), suns=("1", "2"), models=("hapke",), exposures_ms=(256,), scale=0.2, finer=1, every=4,
    )  # fmt: skip
    render_frames(folder, driven.vehicle(), options, 3, render=driven.RENDER)
    return folder, options
