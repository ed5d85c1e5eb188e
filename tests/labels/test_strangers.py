"""Seeds stored under the name of a wrong position, with meshes and poses from scans."""

import logging
from dataclasses import replace

import numpy as np
import pytest

from polarsim.geometry.boxes import box_around_points
from polarsim.labels.seeds import AnnotatedBoxes, drop_mislabelled
from polarsim.photo import PhotoKey

from .conftest import block, localised, terrain_of

LOCALISED = {position: localised(position) for position in "AC"}
PLACES = [(-1.0, -0.8), (-0.6, 0.7), (-0.2, -0.2), (0.1, 0.9), (0.4, -1.0), (0.5, 0.3), (0.9, -0.4), (1.1, 0.8)]
BLOCKS = {k: (np.array([x, y, 0.0]), np.array([0.2, 0.24, 0.12])) for k, (x, y) in enumerate(PLACES, 1)}


@pytest.fixture(scope="module")
def terrain():
    return terrain_of(BLOCKS)


def drawings(**view_of):
    """Return seeds under two Sun lamps for each position, with the boxes of the view `view_of`."""
    made = {}
    for position, view in view_of.items():
        boxes = np.array(
            [box_around_points(LOCALISED[view].project("L", block(*shape).vertices)) for shape in BLOCKS.values()]
        )
        for azimuth in ("30", "270"):
            made[PhotoKey(3, position, "off", azimuth, "L", 256)] = AnnotatedBoxes(
                boxes, boxes + np.array([10, 5, 30, 5])
            )
    return made


def test_mislabelled_seeds_are_skipped_with_a_warning(terrain, caplog):
    given = drawings(A="A", C="A")
    with caplog.at_level(logging.WARNING):
        kept = drop_mislabelled(given, terrain, LOCALISED)
    assert {key.position for key in kept} == {"A"}
    assert len(kept) == 2
    (line,) = [record.getMessage() for record in caplog.records]
    assert "position C" in line
    assert "0% of their boxes" in line


def test_seeds_are_kept_if_only_the_survey_localises_the_camera(terrain):
    given = drawings(A="A", C="A")
    surveyed = {**LOCALISED, "C": replace(LOCALISED["C"], method="survey")}
    assert drop_mislabelled(given, terrain, surveyed) == given
