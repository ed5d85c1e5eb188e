"""Rocks of terrain 13, with a box of one metre on the floor; scans are simulated by the analog's scanner."""

import numpy as np
import pytest

from polarsim.analog import scanner
from polarsim.analog.options import AnalogOptions
from polarsim.analog.rocks import icosphere
from polarsim.analog.terrain import build_terrain
from polarsim.analog.truth import true_rock_row
from polarsim.cameras import icp
from polarsim.cameras.scans import VOXEL
from polarsim.cameras.small_box import small_box_frame
from polarsim.geometry.poses import Pose, angle_between, camera_pose, yaw_pitch_roll
from polarsim.rocks.evidence import Evidence
from polarsim.rocks.find import CONFIRMED_HEIGHT, CONFIRMING_IOU, FOOT_HEIGHT
from polarsim.rocks.ground import GROUND_CELL, find_ground, sand_extent
from polarsim.rocks.options import RocksOptions
from polarsim.rocks.regions import Limits, find_regions
from polarsim.rocks.scans import merge_scans, scan_in_sandbox
from polarsim.survey import half_width

TERRAIN = 13
OPTIONS = AnalogOptions(ground_step_mm=10, rock_detail=4, scan_step_deg=0.2)
UPRIGHT_FROM_CAMERA = Pose(np.array([[0.0, 0, 1], [-1, 0, 0], [0, -1, 0]]), np.zeros(3))


@pytest.fixture(scope="module")
def made():
    return build_terrain(TERRAIN, OPTIONS)


@pytest.fixture(scope="module")
def scans(made):
    """Return the points (n, 3) of two positions in the left camera frame."""
    found = {}
    for number, (position, left) in enumerate(sorted(made.stations.sandbox_from_left.items())[:2]):
        level = camera_pose(left.translation, yaw_pitch_roll(left)[0], 0.0) @ UPRIGHT_FROM_CAMERA.inverse()
        rng = np.random.default_rng(number)
        points = scanner.scan(made.scene, made.caster, level, rng, OPTIONS, 1).points
        found[position] = left.inverse().apply(points[np.isfinite(points[..., 0])])
    return found


def test_three_rocks_are_detected_in_the_frame_of_their_box(made, scans):
    true = made.stations.sandbox_from_left
    level_from_sandbox = Pose.from_rotvec(np.array([0.002, -0.003, 0.1]), np.array([1.6, 0.2, 0.4]))
    level_from_left = {position: level_from_sandbox @ true[position] for position in scans}
    thinned = [
        icp.thin_to_planes(pose.apply(scans[p]), pose.translation, VOXEL).points for p, pose in level_from_left.items()
    ]
    sandbox_from_level = small_box_frame(np.concatenate(thinned), half_width(TERRAIN), level_from_left.values())
    off = sandbox_from_level @ level_from_sandbox
    assert np.linalg.norm(off.translation) < 0.02  # metres: a cell of the map
    assert np.degrees(angle_between(off, Pose.identity())) < 1.0

    both = merge_scans([scan_in_sandbox(scan, sandbox_from_level @ level_from_left[p]) for p, scan in scans.items()])
    extent = sand_extent(both, half_width(TERRAIN))
    options = RocksOptions()
    sand = find_ground(
        both.select(extent.contains(both.points)), extent, GROUND_CELL, np.radians(options.max_sand_slope_deg)
    )
    limits = Limits(FOOT_HEIGHT, options.min_height_mm / 1000, CONFIRMED_HEIGHT, options.min_size_mm / 1000)
    found = find_regions(sand, limits, Evidence({}, {}, CONFIRMING_IOU))
    faces = icosphere(OPTIONS.rock_detail)[1]
    rows = [true_rock_row(rock, made.scene.ground, faces) for rock in made.scene.rocks]
    assert len(found) == len(rows) == 3
    for row in rows:  # the box is not a rock of one metre
        near = min(found, key=lambda region: np.hypot(*(region.centre - [row["x"], row["y"]])))
        assert np.hypot(*(near.centre - [row["x"], row["y"]])) < 0.03
        assert near.size == pytest.approx(row["size_m"], abs=0.03)
