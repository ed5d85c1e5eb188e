"""Rocks out of reach are excluded from the search for contacts without an effect on the drive."""

import numpy as np
import pytest

from polarsim.rover.drive.control import Command
from polarsim.rover.drive.near_rocks import NearRocks
from polarsim.rover.world.surface import bare_world
from tests.rover.drive.test_contacts import made, with_boxes

FAR = 12.0  # m
BOXES = ((0.9, 0.6, 0.1, 0.05), (FAR, 0.6, 0.1, 0.05), (-FAR, 0.0, 0.2, 0.5))


@pytest.fixture
def world():
    """Return level ground of 26 by 2.4 m with a box in front of the rover and two distant boxes."""
    return with_boxes(*BOXES, ground=bare_world(np.zeros((121, 1301)), 0.02, -13.0, -1.2))


def driven(world, lunar):
    simulation = made(world, lunar, 0.3)
    simulation.apply(Command(0.3))
    for _ in range(150):
        simulation.advance(0.01)
    return simulation


def test_a_drive_is_the_same_with_all_rocks(world, lunar, monkeypatch):
    near = driven(world, lunar)
    monkeypatch.setattr(NearRocks, "update", lambda *_: None)
    every = driven(world, lunar)
    np.testing.assert_array_equal(near.data.qpos, every.data.qpos)
    assert near.contacts().equals(every.contacts())
    assert len(near.contacts())  # a wheel drives over the near box


def test_rocks_take_part_within_the_reach_of_the_rover_in_the_time_of_a_call(world, lunar):
    simulation = made(world, lunar)
    bodies = [simulation.model.body(f"rock{rock}").id for rock in simulation.rocks]
    for x, seconds, expected in (
        (0.0, 0.01, [True, False, False]),
        (FAR, 0.01, [False, True, False]),
        (0.0, 0.01, [True, False, False]),  # included again
        (0.0, 10.0, [True, True, True]),
    ):
        simulation._near_rocks.update(np.array([x, 0.0]), seconds)
        for bits in (simulation.model.body_contype, simulation.model.body_conaffinity):
            assert (bits[bodies] != 0).tolist() == expected
