import numpy as np
import pytest

from polarsim.formats import png, yolo
from polarsim.photo import PhotoKey
from polarsim.scenes.strokes import COLOURS, draw_strokes
from tests.support.polar_photos import HEIGHT, SIZE, WIDTH

KEY = PhotoKey.parse("01_A_off_30_L_0256")
ROCKS = np.array([[200.0, 300, 300, 380], [900, 500, 1000, 620]])
SHADOWS = {"30": [300.0, 320, 400, 380], "180": [100.0, 320, 200, 380]}
SAND, SHADE = 90, 10


@pytest.fixture
def cover():
    """Return a photo (h, w, 3) of two rocks with drawn boxes; the first rock has a shadow under lamp 30."""
    photo = np.full((HEIGHT, WIDTH), SAND, np.uint8)
    left, top, right, bottom = map(int, SHADOWS["30"])
    photo[top:bottom, left:right] = SHADE
    return draw_strokes(photo, ROCKS + np.array([-4, -4, 4, 4]), [1, 2], COLOURS[0], 3, 26)


@pytest.fixture
def made_release(tmp_path, cover):
    """Release of terrain 1 with a cover photo at A and labels of both cameras under two lamps."""
    png.write_png(tmp_path / "CoverPhotoOfIndices" / "cover_photo_indexed_01_A.png", cover)
    for side, offset in (("L", 0), ("R", 500)):
        for azimuth, shadow in SHADOWS.items():
            path = tmp_path / "Labels" / "Terrain01" / f"01_A_off_{azimuth}_{side}_0256.txt"
            moved = np.array([offset, 0, offset, 0])
            yolo.write_boxes(path, np.array([0, 0, 1]), np.vstack([ROCKS, [shadow]]) + moved, size=SIZE)
    return tmp_path
