"""Create the images of the explorer for the gallery, from a finished run with Chromium.

    python docs/explorer_pictures.py results/RUN docs/gallery

Each image shows the page at an address that encodes its state.
"""

from __future__ import annotations

import io
import shutil
import sys
import threading
from pathlib import Path

from PIL import Image
from playwright.sync_api import sync_playwright

from polarsim.explore.corrections import Corrections
from polarsim.explore.next_run import changed_labels
from polarsim.explore.server import server
from polarsim.explore.site import page_of_run
from polarsim.photo import PhotoKey
from polarsim.run_files.run import Run

SIZE = {"width": 1100, "height": 640}  # px
LONGEST = 60_000  # maximum time to draw a view, ms
WEBGL = ["--no-sandbox", "--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"]
# By file: state of the page, and a selector that matches the finished view. KEY: a photo (Correct: a corrected photo),
# ROCK: a rock in the photo.
STATES = {
    "photos": ("view=photos&f.camera=L", ".tile img"),
    "compare": (
        "view=compare&key=KEY&left=photo&right=hapke&show=bil&auto=1",
        "#compare [data-drawn='KEY photo hapke']",
    ),
    "terrain": ("view=terrain&colour=id", "#scene[data-drawn]"),
    "detectors": ("view=detectors&confidence=0.3", "#detectors .crop"),
    "rover": ("view=rover&frame=6", "#rover .stage img"),
    "correct": ("view=correct&key=KEY&rock=ROCK", "#correct figure"),
}


def write_pictures(folder: Path, out: Path) -> None:
    """Write a WebP file for each state with data in the run."""
    run = Run.at(folder)
    keys = [key for domain, key in run.pictures if domain == "photo" and key.azimuth == "30"]
    key = next(str(key) for key in keys if key.exposure_ms == 256)
    corrections = Corrections(run)
    corrected = next(iter(corrections.read()), key)
    lacking = {"rover": not run.drives, "detectors": not run.predictions}
    out.mkdir(parents=True, exist_ok=True)
    with server(page_of_run(run, 968), corrections=corrections) as serving, sync_playwright() as playwright:
        threading.Thread(target=serving.serve_forever, daemon=True).start()
        browser = playwright.chromium.launch(executable_path=shutil.which("chromium"), args=WEBGL)
        page = browser.new_page(viewport=SIZE)
        for name, (state, drawn) in STATES.items():
            if lacking.get(name):
                continue
            shown = corrected if name == "correct" else key
            address = state.replace("KEY", shown).replace("ROCK", rock_of(run, PhotoKey.parse(shown)))
            page.goto("about:blank")
            page.goto(f"http://127.0.0.1:{serving.server_address[1]}/#{address}")
            page.locator(drawn.replace("KEY", key)).first.wait_for(timeout=LONGEST)
            page.wait_for_load_state("networkidle")
            picture = Image.open(io.BytesIO(page.screenshot()))
            picture.save(out / f"explorer_{name}.webp", quality=80, method=6)
        browser.close()
        serving.shutdown()


def rock_of(run: Run, key: PhotoKey) -> str:
    """Return the rock of a photo with the largest shift by corrections, else the rock with the largest id."""
    labels, changes = run.labels(key.terrain), changed_labels(run, key.terrain)
    moved = changes[(changes["key"] == str(key)) & (changes["kind"] == "rock") & changes["moved_px"].notna()]
    own = labels.loc[(labels["key"] == str(key)) & (labels["kind"] == "rock"), "rock"]
    return f"{key.terrain}.{own.max() if moved.empty else moved.sort_values('moved_px')['rock'].iloc[-1]}"


if __name__ == "__main__":
    write_pictures(Path(sys.argv[1]), Path(sys.argv[2]))
