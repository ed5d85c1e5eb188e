"""At which widths detectors look at real cover photos best, chosen without the photos that the figures are about.

    python benchmarks/cover_sizes.py results/covers [--seed 0] [--widths 512 640 768 896 1024 1280]

Takes the detectors and cover photos of a run of `snakemake real` and asks every fold's detector about the photos of its
terrains at each width. Widths and gate (`polarsim.detect.sizes`) of a fold are those with the largest mAP@0.5, mean of
rocks and shadows, on the photos of all *other* folds, as their own detectors see them: no detector and no choice has
seen the terrain that it is scored on. The row of each width for all folds is printed beside it; those were not chosen.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

import numpy as np
import pandas as pd

from polarsim.covers.scores import cover_figures
from polarsim.detect import detectors
from polarsim.detect.frame import read_picture
from polarsim.detect.options import PredictionOptions
from polarsim.detect.predict import detect
from polarsim.detect.sizes import Sizes, choose_sizes, merge
from polarsim.formats import tables
from polarsim.photo import BOX_CLASSES, PhotoKey

CORNERS = ["x0", "y0", "x1", "y1"]
OPTIONS = PredictionOptions(nms_iou=0.5)
BoxesByWidth = dict[str, dict[int, np.ndarray]]  # photo -> width -> boxes (n, 6)


def look(covers: Path, fold: str, seed: int, widths: list[int], scratch: Path) -> BoxesByWidth:
    """What a fold's detector finds in the photos of its terrains at each width."""
    detector = detectors.read_detector(covers / "folds" / fold / f"seed{seed}" / "detector.pt")
    loaded = detectors.family(detector.model).load(detector, scratch, OPTIONS, threads=1)
    terrains = set(map(int, fold.split("_")))
    photos = [
        path for path in sorted((covers / "photos").glob("*.png")) if PhotoKey.parse(path.stem).terrain in terrains
    ]
    return {
        path.stem: {
            width: next(detect(loaded, [read_picture(path)], Sizes((width,)), OPTIONS.nms_iou)) for width in widths
        }
        for path in photos
    }


def chosen_sizes(labels: pd.DataFrame, others: BoxesByWidth, widths: list[int]) -> Sizes:
    own = [labels[labels["key"] == key] for key in others]
    truth = [
        (np.array([BOX_CLASSES.index(kind) for kind in rows["kind"]], int), rows[CORNERS].to_numpy(float))
        for rows in own
    ]
    by_width = {width: [found[width] for found in others.values()] for width in widths}
    return choose_sizes(truth, by_width, OPTIONS.nms_iou, detectors.MAX_BOXES)


def as_table(found: BoxesByWidth, sizes: Sizes) -> pd.DataFrame:
    rows = []
    for key, by_width in found.items():
        merged = merge([by_width[width] for width in sizes.widths], sizes, OPTIONS.nms_iou, detectors.MAX_BOXES)
        rows += [(key, BOX_CLASSES[int(row[5])], row[4], *row[:4]) for row in merged]
    return pd.DataFrame(rows, columns=["key", "kind", "confidence", *CORNERS])


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("run", type=Path)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--widths", type=int, nargs="+", default=[512, 640, 768, 896, 1024, 1280])
    given = parser.parse_args()
    covers = given.run / "covers"
    labels = tables.read_parquet(covers / "labels.parquet", tables.LABEL_COLUMNS)
    folds = sorted(path.parents[1].name for path in covers.glob(f"folds/*/seed{given.seed}/detector.pt"))
    found = {fold: look(covers, fold, given.seed, given.widths, given.run) for fold in folds}
    left_out = []
    for fold in folds:
        others = {key: rows for other in folds if other != fold for key, rows in found[other].items()}
        sizes = chosen_sizes(labels, others, given.widths)
        sys.stdout.write(f"fold {fold}: widths {sizes.widths}, gates {sizes.gates_px} px, chosen on the others\n")
        left_out.append(as_table(found[fold], sizes))
    every = {key: rows for own in found.values() for key, rows in own.items()}
    print_row("chosen, left out", labels, pd.concat(left_out))
    for width in given.widths:
        print_row(f"all at {width}", labels, as_table(every, Sizes((width,))))
    sizes = chosen_sizes(labels, every, given.widths)
    print_row(f"chosen on all: {sizes.widths}, {sizes.gates_px}", labels, as_table(every, sizes))


def print_row(name: str, labels: pd.DataFrame, predictions: pd.DataFrame) -> None:
    """mAP@0.5 of rocks and shadows with intervals, and of rocks on each terrain."""
    keys = sorted(predictions["key"].unique())
    texts = [
        f"{row.kind} {row.map50:.3f} [{row.map50_low:.3f}, {row.map50_high:.3f}]"
        for row in cover_figures(labels, predictions, keys, seed=0, resamples=1000).itertuples()
    ]
    for terrain in sorted({PhotoKey.parse(key).terrain for key in keys}):
        own = [key for key in keys if PhotoKey.parse(key).terrain == terrain]
        rock = cover_figures(labels, predictions, own, seed=0, resamples=1)["map50"].iloc[0]
        texts.append(f"{terrain:02d} {rock:.2f}")
    sys.stdout.write(f"{name}: {'; '.join(texts)}\n")


if __name__ == "__main__":
    main()
