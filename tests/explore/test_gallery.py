"""Screenshots of the explorer for the gallery."""

import runpy
import shutil
from pathlib import Path

import pytest
from PIL import Image

pytest.importorskip("playwright.sync_api", reason="needs Playwright: pip install polarsim[dev]")
SCRIPT = Path(__file__).parents[2] / "docs/explorer_pictures.py"


@pytest.mark.slow
@pytest.mark.skipif(shutil.which("chromium") is None, reason="needs Chromium: apt-get install chromium")
def test_all_screenshots_of_the_gallery_are_written(made, tmp_path):
    script = runpy.run_path(str(SCRIPT))
    script["SIZE"].update(width=550, height=320)
    script["WEBGL"].append("--disable-gpu-compositing")  # quicker without a GPU
    script["write_pictures"](made, tmp_path)
    shown = {path.name for path in (SCRIPT.parent / "gallery").glob("explorer_*.webp")}
    assert {path.name for path in tmp_path.iterdir()} == shown
    for path in tmp_path.iterdir():
        assert len(Image.open(path).getcolors(1 << 24)) > 100  # a page, not a black one
