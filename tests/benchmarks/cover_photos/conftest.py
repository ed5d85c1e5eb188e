import numpy as np
import pytest

from benchmarks.cover_photos.strokes import REDS, draw_strokes
from polarsim.formats import png, yolo
from polarsim.photo import HEIGHT, WIDTH, PhotoKey
from tests.render.conftest import blocks, camera, folders, lens  # noqa: F401  fixtures

KEY = PhotoKey.parse("01_A_off_30_L_0256")
ROCKS = np.array([[200.0, 300, 300, 380], [900, 500, 1000, 620]])


@pytest.fixture
def made_release(tmp_path):
    """Terrain 1 with a cover photo at A and labels of both cameras, the right one's elsewhere."""
    photo = np.full((HEIGHT, WIDTH), 90, np.uint8)
    cover = draw_strokes(photo, ROCKS + np.array([-4, -4, 4, 4]), [1, 2], REDS[0], 3, 26)
    png.write(tmp_path / "CoverPhotoOfIndices" / "cover_photo_indexed_01_A.png", cover)
    for side, shift in (("L", 0), ("R", 150)):
        moved = np.array([shift, 0, shift, 0])
        path = tmp_path / "Labels" / "Terrain01" / f"01_A_off_30_{side}_0256.txt"
        yolo.write_boxes(path, np.array([0, 0, 1]), np.vstack([ROCKS, [[300, 320, 400, 380]]]) + moved)
    return tmp_path
