"""Speed of the detect stage: data set, training, prediction, figures, in CPU seconds a picture on one thread.

    python benchmarks/detect.py [longer sides in px ...]

Pictures are noise with blobs; 24 train, 8 are predicted. CPU seconds, since wall time depends on what else runs.

Last figures (AMD EPYC, Zen 4, busy machine): imgsz 352: data set 42 ms, training 104 ms, prediction 63 ms a picture;
average precision 3 ms a picture and class.
"""

from __future__ import annotations

import shutil
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
import pandas as pd

from polarsim.detect import metrics
from polarsim.detect.dataset import make_dataset
from polarsim.detect.options import PicturesOptions, PredictionOptions, TrainingOptions
from polarsim.detect.predict import predict
from polarsim.detect.train import train_detector
from polarsim.formats import png, tables
from polarsim.photo import HEIGHT, WIDTH, PhotoKey, photo_grid

PARTS = ["train"] * 24 + ["val"] * 2 + ["test"] * 8


def make_photos(root: Path) -> list[PhotoKey]:
    """Photos of noise with 20 bright blobs each, their labels and their split."""
    random = np.random.default_rng(0)
    keys = sorted(photo_grid(1))[: len(PARTS)]
    photos, labels = [], []
    for key in keys:
        pixels = random.normal(400, 40, (HEIGHT, WIDTH))
        for rock in range(1, 21):
            x0, y0 = random.uniform(0, WIDTH - 120), random.uniform(0, HEIGHT - 90)
            x1, y1 = x0 + random.uniform(30, 120), y0 + random.uniform(25, 90)
            pixels[int(y0) : int(y1), int(x0) : int(x1)] = 2000
            label = {"kind": "rock", "rock": rock, "source": "truth", "confidence": 1.0}
            labels.append(tables.key_columns(key) | label | {"x0": x0, "y0": y0, "x1": x1, "y1": y1})
        path = root / f"{key}.png"
        png.write(path, np.clip(pixels, 16, 4095).astype(np.uint16))
        photos.append({"key": str(key), "path": str(path)})
    tables.write_parquet(root / "photos.parquet", pd.DataFrame(photos))
    tables.write_parquet(root / "labels.parquet", tables.label_table(labels))
    tables.write_csv(root / "split.csv", pd.DataFrame({"key": [str(key) for key in keys], "part": PARTS}))
    return keys


def measure(root: Path, imgsz: int) -> dict[str, float]:
    """CPU seconds a picture of each step; training without its start-up: 5 epochs less 1, over the difference."""
    prediction = PredictionOptions(device="cpu")
    start = time.process_time()
    make_dataset(
        domain="analog",
        pictures=root / "photos.parquet",
        labels=root / "labels.parquet",
        split=root / "split.csv",
        dataset=root / "dataset",
        options=PicturesOptions(imgsz=imgsz),
    )
    seconds = {"dataset": (time.process_time() - start) / len(PARTS)}
    training = {}
    for epochs in (1, 1, 5):  # the first pays for the imports
        start = time.process_time()
        train_detector(
            dataset=root / "dataset",
            weights=root / "detector.pt",
            curve=root / "detector.csv",
            options=TrainingOptions(epochs=epochs),
            prediction=prediction,
            imgsz=imgsz,
            seed=0,
            threads=1,
            work=root / "work",
        )
        training[epochs] = time.process_time() - start
    seconds["train"] = (training[5] - training[1]) / 4 / PARTS.count("train")
    start = time.process_time()
    predict(
        weights=root / "detector.pt",
        dataset=root / "dataset",
        predictions=root / "predictions.parquet",
        options=prediction,
        threads=1,
    )
    seconds["predict"] = (time.process_time() - start) / PARTS.count("test")
    return seconds


def measure_precision() -> float:
    """CPU seconds a picture and class of `average_precision`: 20 labels, 300 predictions."""
    random = np.random.default_rng(0)
    low = random.uniform(0, 1000, (100, 20, 2))
    labels = np.concatenate([low, low + random.uniform(30, 120, low.shape)], axis=2)
    predictions = labels.repeat(15, axis=1) + random.normal(0, 10, (100, 300, 4))
    confidences = random.uniform(0, 1, (100, 300))
    start = time.process_time()
    metrics.average_precision(list(labels), list(predictions), list(confidences))
    return (time.process_time() - start) / 100


def main() -> None:
    sizes = [int(text) for text in sys.argv[1:]] or [320, 352, 448, 640]
    root = Path(tempfile.mkdtemp())
    try:
        make_photos(root)
        for imgsz in sizes:
            figures = ", ".join(f"{step} {1000 * value:.0f} ms" for step, value in measure(root, imgsz).items())
            sys.stdout.write(f"imgsz {imgsz}: {figures} a picture\n")
        sys.stdout.write(f"average precision: {1000 * measure_precision():.1f} ms a picture and class\n")
    finally:
        shutil.rmtree(root)


if __name__ == "__main__":
    main()
