import numpy as np
import pytest

from polarsim.formats import yolo
from polarsim.photo import PhotoKey
from polarsim.site import polar
from tests.support.polar_photos import SIZE

KEY = PhotoKey.parse("11_A_off_30_L_0256")
LABELS = "Labels/Terrain11"
ROCKS = np.array([[100, 100, 160, 150], [500, 600, 580, 660], [900, 300, 960, 350]], float)
SHADOWS = ROCKS + np.array([60, 10, 60, 10])
CLASSES = np.array([0] * 3 + [1] * 3)
BOXES = np.concatenate([ROCKS, SHADOWS])


@pytest.fixture
def root(tmp_path):
    """Write a complete exposure bracket of labels; shadows from 128 ms."""
    for exposure_ms in polar().exposures_of(11, "30"):
        shown = (2 if exposure_ms >= 128 else 1) > CLASSES
        yolo.write_boxes(path(tmp_path / "tree", exposure_ms), CLASSES[shown], BOXES[shown], size=SIZE)
    return tmp_path / "tree"


def path(root, exposure_ms):
    return root / LABELS / f"{KEY.with_exposure(exposure_ms)}.txt"
