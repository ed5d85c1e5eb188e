"""Agreement of people on cover photos: their labels of the same view under another lamp, scored as predictions.

.venv/bin/python -m benchmarks.redrawn --covers results/covers/covers [--root data/polar-sim]

Rocks do not move between lamps, so that boxes of two azimuths of a camera are repeated annotations of the same object:
a detector cannot agree with people much better. The confidence is the area of a box. Shadows are not scored.
"""

from __future__ import annotations

import argparse
import os
from pathlib import Path

import numpy as np
import pandas as pd

from polarsim.config import RELEASE_ROOT
from polarsim.cover_photos.photos import annotation_rows
from polarsim.cover_photos.scores import cover_metrics
from polarsim.formats import release, tables
from polarsim.photo import ROCK, PhotoKey
from polarsim.site import polar


def redrawn(root: Path, keys: list[PhotoKey], azimuth: str) -> pd.DataFrame:
    """Return labels of some photos under another azimuth as predictions; empty without labels."""
    rows = []
    for key in keys:
        files = release.label_files(root, key.terrain)
        others = [
            other
            for other in files
            if (other.position, other.light, other.camera) == (key.position, key.light, key.camera)
            and other.azimuth == azimuth != key.azimuth
        ]
        if others:
            other = min(others, key=lambda one: abs(np.log(one.exposure_ms / key.exposure_ms)))
            rows += [row | {"key": str(key)} for row in annotation_rows(other, files[other], polar().images.size)]
    table = pd.DataFrame(rows)
    area = (table["x1"] - table["x0"]) * (table["y1"] - table["y0"])
    return table.assign(confidence=area / np.prod(polar().images.size))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--covers", type=Path, required=True, help="folder `covers` of a run")
    parser.add_argument("--root", type=Path, default=Path(os.environ.get(RELEASE_ROOT, "data/polar-sim")))
    asked = parser.parse_args()
    labels = tables.read_parquet(asked.covers / "labels.parquet", tables.LABEL_COLUMNS)
    labels = labels[labels["kind"] == ROCK]
    keys = [PhotoKey.parse(key) for key in labels["key"].unique()]
    print("rocks, mAP@0.5 of people's labels under another lamp")
    for azimuth in polar().azimuths:
        found = redrawn(asked.root, keys, azimuth) if azimuth != "no" else pd.DataFrame()
        if found.empty:
            continue
        shown = [str(key) for key in keys if str(key) in set(found["key"])]
        for name in ("all", *sorted({key[:2] for key in shown})):
            own = [key for key in shown if name in ("all", key[:2])]
            row = cover_metrics(labels, [found], own, resamples=1000).iloc[0]
            print(
                f"azimuth {azimuth}, terrain {name}, {len(own)} photos: "
                f"{row['map50']:.3f} [{row['map50_low']:.3f}, {row['map50_high']:.3f}]"
            )


if __name__ == "__main__":
    main()
