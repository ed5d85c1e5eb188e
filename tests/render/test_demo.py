"""The demonstration `polarsim render --demo`: a generated scene, rendered and labelled without a run."""

import subprocess
import sys

import numpy as np
import pandas as pd
import pytest

from polarsim.formats import png

_HEAVY = ("torch", "open3d", "pycolmap", "ultralytics", "snakemake")
_CALL = f"""
import sys
from polarsim.__main__ import main
sys.argv = ["polarsim", "render", "--demo", "out", "--scale", "0.1"]
try:
    main()
except SystemExit as end:
    assert not end.code, end.code
assert not [name for name in {_HEAVY} if name in sys.modules]
"""


@pytest.fixture(scope="module")
def demo(tmp_path_factory):
    """Folder of the demonstration at a tenth of the size, and the printed text."""
    here = tmp_path_factory.mktemp("demo")
    done = subprocess.run([sys.executable, "-c", _CALL], cwd=here, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return here / "out", done.stdout


def test_the_demo_has_two_models_under_four_suns_with_labels(demo):
    folder, printed = demo
    index = pd.read_csv(folder / "views/index.csv")
    assert index.groupby("model")["azimuth_deg"].nunique().to_dict() == {"hapke": 4, "principled": 4}
    assert index["rocks"].min() >= 5
    assert (index["shadows"] > 0).all()
    for name in index["name"]:
        assert np.ptp(np.percentile(png.read_png(folder / f"views/images/{name}.png"), [10, 90])) > 40
    assert "out/contact.png" in printed
    assert "polarsim render out/meshes" in printed  # the next command


def test_the_sheet_of_the_demo_shows_all_images_and_labels(demo):
    pixels = png.read_png(demo[0] / "contact.png")[..., :3].astype(int)
    height, width = pixels.shape[:2]
    assert width == 2400
    for row in (0.3, 0.75):
        for column in (0.12, 0.37, 0.62, 0.87):
            x, y = round(column * width), round(row * height)
            assert np.ptp(pixels[y - 60 : y + 60, x - 60 : x + 60]) > 60
    for colour in ((255, 176, 0), (70, 190, 255)):
        assert (np.abs(pixels[: height // 2] - colour).max(axis=-1) < 10).sum() > 100
