"""Detectors trained on twins alone, tested on the real cover photos of terrains that were left out of their training.

    python benchmarks/covers.py config/covers.yaml [--set KEY=VALUE ...] [--stop-before train]

`--set` changes a key of the file: `--set detect.training.epochs=10 variants.number=6 out=results/covers_small`. Steps
whose output is there are not done again, so a run that was stopped goes on; another configuration needs another `out`.

Not a rule of the workflow: it needs cameras and meshes of another run, trains a detector a fold, which takes hours on a
CPU, and tests on ten photos that no other rule knows. It calls the stages' functions in the workflow's order, and all
that passes between them is files:

    pairing.csv                how well the boxes drawn into each cover photo fit the labels of each photo
    photos/, labels.parquet    cover photos without their strokes, and their published boxes
    twins/TerrainTT/           varied twins (YOLO layout)
    folds/T_T/                 data set, detector, curve and predictions of the detector that has not seen terrains T
    tables/covers.{csv,md}     pooled over all cover photos, and each fold's; intervals by bootstrap over photos
    figures/covers.png         labels (green) and predictions (orange: above the confidence of the best F1) of rocks
"""

from __future__ import annotations

import argparse
import logging
import os
import shutil
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pandas as pd
import yaml
from cover_photos.dataset import CoverOptions, make_cover_dataset
from cover_photos.photos import pair_covers, read_covers
from cover_photos.scores import cover_figures
from cover_photos.variants import VariantOptions
from cover_photos.varied import render_varied
from pydantic import BaseModel

from polarsim.detect.detectors import detector_name
from polarsim.detect.metrics import rank
from polarsim.detect.options import DetectOptions
from polarsim.detect.predict import predict
from polarsim.detect.train import train_detector
from polarsim.errors import DetectError
from polarsim.formats import png, tables
from polarsim.formats.files import write_text
from polarsim.formats.yaml_files import read_yaml
from polarsim.photo import ROCK, PhotoKey

CORNERS = ["x0", "y0", "x1", "y1"]
GREEN, ORANGE = (60, 220, 60), (0, 150, 255)  # BGR
log = logging.getLogger("polarsim")


class Experiment(BaseModel, extra="forbid", frozen=True):
    root: Path
    run: Path
    out: Path
    covers: tuple[str, ...]
    folds: tuple[tuple[int, ...], ...]
    variants: VariantOptions = VariantOptions()
    dataset: CoverOptions = CoverOptions()
    detect: DetectOptions = DetectOptions()

    @property
    def keys(self) -> list[PhotoKey]:
        return [PhotoKey.parse(text) for text in self.covers]

    @property
    def terrains(self) -> list[int]:
        return sorted({key.terrain for key in self.keys})


def fold_name(fold: tuple[int, ...]) -> str:
    return "_".join(f"{terrain:02d}" for terrain in fold)


def read_test(experiment: Experiment) -> None:
    """Cover photos, labels, pairing."""
    out = experiment.out
    if not (out / "pairing.csv").exists():
        pair_covers(experiment.root, experiment.keys, out / "pairing.csv")
    if not (out / "labels.parquet").exists():
        read_covers(root=experiment.root, keys=experiment.keys, pictures=out / "photos", labels=out / "labels.parquet")


def render(experiment: Experiment, terrain: int) -> None:
    place = f"Terrain{terrain:02d}"
    if not (experiment.out / "twins" / place).exists():
        render_varied(
            terrain=terrain,
            cameras=experiment.run / "cameras" / place,
            meshes=experiment.run / "meshes" / place,
            pictures=experiment.out / "twins" / place,
            options=experiment.variants,
            threads=1,
        )


def train_and_predict(experiment: Experiment, fold: tuple[int, ...], threads: int) -> None:
    folder = experiment.out / "folds" / fold_name(fold)
    if (folder / "predictions.parquet").exists():
        return
    if not (folder / "dataset").exists():
        make_cover_dataset(
            twins={t: experiment.out / "twins" / f"Terrain{t:02d}" for t in experiment.terrains if t not in fold},
            covers=experiment.out / "photos",
            test=[key for key in experiment.keys if key.terrain in fold],
            dataset=folder / "dataset",
            imgsz=experiment.detect.pictures.imgsz,
            options=experiment.dataset,
        )
    if not (folder / "detector.pt").exists():
        train_detector(
            dataset=folder / "dataset",
            weights=folder / "detector.pt",
            curve=folder / "curve.csv",
            options=experiment.detect.training,
            prediction=experiment.detect.prediction,
            imgsz=experiment.detect.pictures.imgsz,
            seed=experiment.detect.seeds[0],
            threads=threads,
            work=folder / "work",
        )
        shutil.rmtree(folder / "work", ignore_errors=True)
    predict(
        weights=folder / "detector.pt",
        dataset=folder / "dataset",
        predictions=folder / "predictions.parquet",
        options=experiment.detect.prediction,
        threads=threads,
    )


def tabulate(experiment: Experiment) -> None:
    """Figures of all cover photos that a detector was tested on, pooled, and of every fold."""
    out, detect = experiment.out, experiment.detect
    labels = tables.read_parquet(out / "labels.parquet", tables.LABEL_COLUMNS)
    found = {
        fold: tables.read_parquet(path, ("key", "kind", "confidence", *CORNERS))
        for fold in experiment.folds
        if (path := out / "folds" / fold_name(fold) / "predictions.parquet").exists()
    }
    if not found:
        raise DetectError("no predictions of any fold", path=out / "folds")
    parts = []
    pooled = tuple(terrain for fold in found for terrain in fold)
    for terrains, name, predictions in [
        (pooled, "all" if len(found) == len(experiment.folds) else "some folds", pd.concat(found.values())),
        *((fold, fold_name(fold), predictions) for fold, predictions in found.items()),
    ]:
        keys = [str(key) for key in experiment.keys if key.terrain in terrains]
        figures = cover_figures(
            labels, predictions, keys, seed=detect.comparison.seed, resamples=detect.comparison.resamples
        )
        figures.insert(0, "terrains", name)
        parts.append(figures)
    table = pd.concat(parts, ignore_index=True).round(4)
    table = table.assign(
        detector=detector_name(detect.training.model),
        start=detect.training.start,
        epochs=detect.training.epochs,
        imgsz=detect.pictures.imgsz,
        folds=len(experiment.folds),
        twins_a_terrain=len(list((out / "twins" / f"Terrain{experiment.terrains[0]:02d}" / "images").glob("*.png"))),
    )
    tables.write_csv(out / "tables" / "covers.csv", table)
    head = "| " + " | ".join(table.columns) + " |\n|" + "---|" * len(table.columns) + "\n"
    rows = "".join("| " + " | ".join(map(str, row)) + " |\n" for row in table.itertuples(index=False))
    write_text(out / "tables" / "covers.md", head + rows)
    print(head + rows)
    draw(experiment, labels, pd.concat(found.values()))


def best_confidence(labels: pd.DataFrame, predictions: pd.DataFrame) -> float:
    """Confidence at which the F1 of all predictions, IoU of 0.5 or more, is largest."""
    own = [(labels[labels["key"] == key], found) for key, found in predictions.groupby("key")]
    ranked = rank(
        [truth[CORNERS].to_numpy(float) for truth, _ in own],
        [found[CORNERS].to_numpy(float) for _, found in own],
        [found["confidence"].to_numpy(float) for _, found in own],
        np.array([0.5]),
    )
    hits = ranked.right[0, 0].cumsum()
    f1 = 2 * hits / (np.arange(1, len(hits) + 1) + len(labels))
    return float(ranked.confidence[f1.argmax()])


def draw(experiment: Experiment, labels: pd.DataFrame, predictions: pd.DataFrame) -> None:
    labels, predictions = labels[labels["kind"] == ROCK], predictions[predictions["kind"] == ROCK]
    labels = labels[labels["key"].isin(predictions["key"].unique())]
    if predictions.empty:
        return
    least = best_confidence(labels, predictions)
    panels = []
    for key in map(str, experiment.keys):
        picture = cv2.cvtColor(png.read(experiment.out / "photos" / f"{key}.png"), cv2.COLOR_GRAY2BGR)
        shown = predictions[(predictions["key"] == key) & (predictions["confidence"] >= least)]
        for table, colour in ((labels[labels["key"] == key], GREEN), (shown, ORANGE)):
            for x0, y0, x1, y1 in table[CORNERS].round().astype(int).to_numpy().tolist():
                cv2.rectangle(picture, (x0, y0), (x1, y1), colour, 4)
        cv2.putText(
            picture, f"{key}  confidence {least:.2f}", (20, 60), cv2.FONT_HERSHEY_SIMPLEX, 2, (255, 255, 255), 4
        )
        panels.append(cv2.resize(picture, None, fx=0.5, fy=0.5, interpolation=cv2.INTER_AREA))
    if len(panels) % 2:
        panels.append(np.zeros_like(panels[0]))
    rows = [np.hstack(panels[n : n + 2]) for n in range(0, len(panels), 2)]
    (experiment.out / "figures").mkdir(parents=True, exist_ok=True)
    png.write(experiment.out / "figures" / "covers.png", np.ascontiguousarray(np.vstack(rows)[..., ::-1]))


def read_experiment(path: Path, changes: list[str]) -> Experiment:
    content: dict[str, Any] = read_yaml(path)
    content["root"] = os.environ.get("POLAR_SIM_ROOT", content["root"])
    for change in changes:
        name, _, value = change.partition("=")
        place = content
        *above, last = name.split(".")
        for part in above:
            place = place.setdefault(part, {})
        place[last] = yaml.safe_load(value)
    return Experiment.model_validate(content)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("config", type=Path)
    parser.add_argument("--set", nargs="*", default=[], metavar="KEY=VALUE")
    parser.add_argument("--threads", type=int, default=1, help="of torch")
    parser.add_argument("--stop-before", choices=["render", "train"])
    arguments = parser.parse_args()
    logging.basicConfig(level=logging.INFO, format="%(message)s")
    experiment = read_experiment(arguments.config, arguments.set)
    read_test(experiment)
    if arguments.stop_before == "render":
        return
    for terrain in experiment.terrains:
        render(experiment, terrain)
    if arguments.stop_before == "train":
        return
    for fold in experiment.folds:
        train_and_predict(experiment, fold, arguments.threads)
    tabulate(experiment)


if __name__ == "__main__":
    main()
