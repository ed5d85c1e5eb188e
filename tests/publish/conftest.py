from pathlib import Path

import pandas as pd
import pytest

from polarsim.formats.tables import write_parquet
from polarsim.geometry.trajectories import POSE_COLUMNS
from polarsim.publish.catalogue import Catalogue
from polarsim.publish.catalogue_reader import read_catalogue
from polarsim.publish.run import publish_forms
from tests.publish.tiny import make_run

ESTIMATES = {("odometry", ""): 1.02, ("fused", "1_hapke_0256"): 1.005, ("fused", "4_hapke_0256"): 1.1}


def estimate(table: pd.DataFrame, scale: float, estimator: str, pictures: str) -> pd.DataFrame:
    """Return the poses of every tenth row of a trace, with a path that is too long by a factor."""
    poses = table[list(POSE_COLUMNS)].iloc[::10]
    start = poses["x_m"].iloc[0]
    return poses.assign(x_m=start + scale * (poses["x_m"] - start), estimator=estimator, pictures=pictures)


@pytest.fixture(scope="session")
def run(tmp_path_factory) -> Path:
    return make_run(tmp_path_factory.mktemp("tiny"))


@pytest.fixture(scope="session")
def catalogue(run) -> Catalogue:
    return read_catalogue(run)


@pytest.fixture(scope="session")
def published(run, tmp_path_factory):
    """Return a function that gives the folder of a format, written once per session."""
    out = tmp_path_factory.mktemp("out")

    def folder(form: str) -> Path:
        if not (out / form).exists():
            publish_forms(run, out, [form])
        return out / form

    return folder


@pytest.fixture(scope="session")
def drive(tmp_path_factory) -> Path:
    """Write a simulated drive with a stereo pair, two estimates and a bag in a separate run."""
    from polarsim.rover.export.bag import write_bag
    from polarsim.rover.export.options import BagOptions
    from polarsim.rover.vehicle.table import read_vehicle
    from tests.rover.drives import write_drive

    vehicle = read_vehicle(Path(__file__).parents[2] / "config/viper.yaml")
    folder = make_run(tmp_path_factory.mktemp("driven")) / "rover/seed0"
    trace = write_drive(folder, vehicle, ("front_end_cam", "ncl", "ncr"))
    estimates = [estimate(trace.table, scale, *name) for name, scale in ESTIMATES.items()]
    write_parquet(folder / "localisation/estimates.parquet", pd.concat(estimates, ignore_index=True))
    write_bag(folder, folder / "drive.mcap", vehicle, BagOptions())
    return folder


@pytest.fixture(scope="session")
def drives_published(drive, tmp_path_factory):
    """Return a function that gives the folder of a format for the run with the drive."""
    out = tmp_path_factory.mktemp("drives")

    def folder(form: str) -> Path:
        if not (out / form).exists():
            publish_forms(drive.parents[1], out, [form])
        return out / form

    return folder
