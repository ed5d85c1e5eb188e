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

from polarsim.explore.server import server
from polarsim.explore.site import page_of_run
from polarsim.run_files.run import Run

SIZE = {"width": 1100, "height": 640}  # px
LONGEST = 60_000  # maximum time to draw a view, ms
WEBGL = ["--no-sandbox", "--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"]
# By file: state of the page, and a selector that matches the finished view. KEY: a photo, ROCK: a rock in the photo.
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
    key = next(str(key) for domain, key in run.pictures if domain == "photo" and key.azimuth == "30")
    labels = run.labels(run.terrains[0])
    rock = labels.loc[(labels["key"] == key) & (labels["kind"] == "rock"), "rock"].max()
    lacking = {"rover": not run.drives, "detectors": not run.predictions}
    out.mkdir(parents=True, exist_ok=True)
    with server(page_of_run(run, 968)) as serving, sync_playwright() as playwright:
        threading.Thread(target=serving.serve_forever, daemon=True).start()
        browser = playwright.chromium.launch(executable_path=shutil.which("chromium"), args=WEBGL)
        page = browser.new_page(viewport=SIZE)
        for name, (state, drawn) in STATES.items():
            if lacking.get(name):
                continue
            address = state.replace("KEY", key).replace("ROCK", f"{run.terrains[0]}.{rock}")
            page.goto("about:blank")
            page.goto(f"http://127.0.0.1:{serving.server_address[1]}/#{address}")
            page.locator(drawn.replace("KEY", key)).first.wait_for(timeout=LONGEST)
            page.wait_for_load_state("networkidle")
            picture = Image.open(io.BytesIO(page.screenshot()))
            picture.save(out / f"explorer_{name}.webp", quality=80, method=6)
        browser.close()
        serving.shutdown()


if __name__ == "__main__":
    write_pictures(Path(sys.argv[1]), Path(sys.argv[2]))
