"""Time that the explorer's page needs to filter all of NASA's photos and two models' twins, in headless Chromium.

    python benchmarks/explore.py

Needs Chromium and polarsim[browser]. The run is synthetic: 5,190 photos of the grid with two twins each.

Last metrics (AMD EPYC, two cores, load 11): page 54 kB gzipped, columns of 15,570 pictures 680 kB; ready after 0.8 s;
filters 0.3 to 7 ms.
"""

from __future__ import annotations

import gzip
import json
import shutil
import threading
import time

import numpy as np
import pandas as pd

from polarsim.explore.server import server
from polarsim.explore.site import Files, page_files
from polarsim.formats import arrow
from polarsim.formats.tables import key_columns
from polarsim.site import polar

DOMAINS = ("photo", "hapke", "principled")
FLAGS = ["--no-sandbox", "--disable-dev-shm-usage", "--use-gl=angle", "--use-angle=swiftshader"]


def synthetic_page() -> Files:
    """Return the page with a table of pictures, without the picture files."""
    keys = [key for terrain in polar().terrains for key in polar().photos_of(terrain)]
    table = pd.DataFrame([{**key_columns(key), "domain": domain} for key in keys for domain in DOMAINS])
    random = np.random.default_rng(1)
    for name in ("score", "confidence", "min_confidence"):
        table[name] = random.random(len(table))
    table["rocks"], table["shadows"], table["defect"] = 20, 20, ""
    about = {
        "run": "made_up",
        "terrains": list(polar().terrains),
        "domains": list(DOMAINS),
        "width": 1936,
        "height": 1216,
    }
    about |= {name: [] for name in ("meshes", "predictions", "drives", "seeds", "undone")}
    columns, told = arrow.encode_arrow(table), json.dumps(about).encode()
    return {**page_files(), "data/run.json": lambda: told, "data/pictures.arrow": lambda: columns}


def main() -> None:
    from playwright.sync_api import sync_playwright

    files = synthetic_page()
    packed = sum(len(gzip.compress(content())) for content in page_files().values())
    print(
        f"page: {packed / 1e3:.1f} kB gzipped; columns of pictures: {len(files['data/pictures.arrow']()) / 1e3:.0f} kB"
    )
    with server(files) as running, sync_playwright() as browsers:
        threading.Thread(target=running.serve_forever, daemon=True).start()
        chromium = browsers.chromium.launch(executable_path=shutil.which("chromium"), args=FLAGS)
        page = chromium.new_page(viewport={"width": 1400, "height": 850})
        start = time.perf_counter()
        page.goto(f"http://127.0.0.1:{running.server_address[1]}/")
        page.wait_for_selector("body[data-ready=yes]")
        print(f"open to ready: {time.perf_counter() - start:.2f} s")
        for field, value in (("light", "on"), ("domain", "hapke"), ("azimuth", "30"), ("camera", "L")):
            page.locator(f"input[name={field}][value='{value}']").check()
            page.wait_for_timeout(300)
            found, took = page.evaluate(
                "[document.getElementById('count').textContent, document.getElementById('count').dataset.ms]"
            )
            print(f"{field} {value}: {found}, {took} ms")
        chromium.close()
        running.shutdown()


if __name__ == "__main__":
    main()
