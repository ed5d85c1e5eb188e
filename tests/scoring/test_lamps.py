import numpy as np
import pytest

from polarsim.geometry.poses import Pose
from polarsim.run_files.lamps import write_suns
from polarsim.scoring.cameras import lamps_against_truth
from polarsim.site import polar

OTHER_FROM_TRUTH = Pose.from_rotvec(np.array([0.0, 0.0, 0.3]), np.array([0.1, -0.05, 0.0]))


def errors(folder, truth_from_sandbox):
    metrics = lamps_against_truth(polar(), 1, folder / "own/cameras", folder / "truth", truth_from_sandbox)
    return {(metric.subject, metric.metric): metric.value for metric in metrics}


def test_a_lamp_in_the_true_direction_has_no_error_at_any_distance(tmp_path, world, sun_lamps):
    world.write(tmp_path / "truth")
    world.write(tmp_path / "own", OTHER_FROM_TRUTH)
    farther = {azimuth: OTHER_FROM_TRUTH.apply(1.1 * np.array(position)) for azimuth, position in sun_lamps.items()}
    write_suns(tmp_path / "own/cameras", farther)
    found = errors(tmp_path, OTHER_FROM_TRUTH.inverse())
    assert found["worst lamp", "direction_error"] < 0.01  # degrees: positions are written to 0.1 mm
    assert found["worst lamp", "surveyed_direction_error"] > 1


def test_a_lamp_that_was_not_localised_has_the_surveyed_position(tmp_path, world, sun_lamps):
    world.write(tmp_path / "truth")
    world.write(tmp_path / "own")
    write_suns(tmp_path / "own/cameras", {"30": sun_lamps["30"] + np.array([0, 0, 0.1])})
    found = errors(tmp_path, Pose.identity())
    height, away = sun_lamps["30"][2], np.hypot(*sun_lamps["30"][:2])
    raised = np.degrees(np.arctan2(height + 0.1, away) - np.arctan2(height, away))
    assert found["lamp 30", "direction_error"] == pytest.approx(raised, abs=0.01)
    assert found["lamp 180", "direction_error"] == found["lamp 180", "surveyed_direction_error"] > 0
