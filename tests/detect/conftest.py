"""Small data set for detectors: bright blobs with a dark shadow on the right, on grey noise."""

import os
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from polarsim.detect.dataset import make_dataset
from polarsim.detect.options import PicturesOptions, PredictionOptions, SplitOptions, TrainingOptions
from polarsim.detect.split import split_photos
from polarsim.detect.train import train_detector
from polarsim.formats import png, tables
from polarsim.photo import ROCK, SHADOW, PhotoKey
from tests.support.polar_photos import HEIGHT, SIZE, WIDTH

os.environ.setdefault("OMP_WAIT_POLICY", "PASSIVE")  # as in `devices`, before any test imports torch

KEYS = [
    PhotoKey(terrain, position, "off", azimuth, camera, exposure)
    for terrain in (1, 4)
    for position in "AB"
    for azimuth in ("30", "180")
    for camera in "LR"
    for exposure in (64, 128, 256)
][:40]


def blobs(key: PhotoKey) -> tuple[np.ndarray, list[dict[str, object]]]:
    """Return a photo (h, w) uint16 and the rows of its labels."""
    random = np.random.default_rng(KEYS.index(key))
    noise = random.normal(400, 30, (HEIGHT // 8, WIDTH // 8)).astype(np.float32)
    pixels = np.tile(noise, (8, 8))
    rows = []
    for rock in range(1, 6):
        width, height = random.uniform(150, 260), random.uniform(110, 190)
        x0 = random.uniform(0, 180) + (rock - 1) * 360
        y0 = random.uniform(50, HEIGHT - 250)
        boxes = {ROCK: (x0, y0, x0 + width, y0 + height)}
        boxes[SHADOW] = (x0 + width, y0 + 20, min(x0 + 1.6 * width, WIDTH), y0 + height)
        for kind, value in ((ROCK, 1800), (SHADOW, 60)):
            box = boxes[kind]
            pixels[round(box[1]) : round(box[3]), round(box[0]) : round(box[2])] = value
            rows.append(
                tables.key_columns(key)
                | {"kind": kind, "rock": rock, "source": "truth", "confidence": 1.0}
                | dict(zip(("x0", "y0", "x1", "y1"), box, strict=True))
            )
    return np.clip(pixels, 16, 4095).astype(np.uint16), rows


@pytest.fixture(scope="session")
def keys() -> list[PhotoKey]:
    """Keys of the photos."""
    return KEYS


@pytest.fixture(scope="session")
def world(tmp_path_factory) -> Path:
    """Folder with photos.parquet, twins/, labels.parquet."""
    root = tmp_path_factory.mktemp("world")
    photos, labels = [], []
    for key in KEYS:
        pixels, rows = blobs(key)
        path = root / "twins" / f"Terrain{key.terrain:02d}" / f"{key}.png"
        png.write_png(path, pixels)
        photos.append(tables.key_columns(key) | {"path": str(path)})
        labels += rows
    tables.write_parquet(root / "photos.parquet", pd.DataFrame(photos))
    tables.write_parquet(root / "labels.parquet", tables.label_table(labels))
    return root


def make_real(world: Path, keys, root: Path, imgsz: int) -> Path:
    """Write the data set of a random split of the photos; return the folder."""
    split_photos(keys=list(keys), by="photo", split=root / "split.csv", options=SplitOptions())
    make_dataset(
        domain="real",
        pictures=world / "photos.parquet",
        labels=world / "labels.parquet",
        split=root / "split.csv",
        dataset=root / "real",
        options=PicturesOptions(imgsz=imgsz),
        size=SIZE,
    )
    return root / "real"


def train(dataset: Path, folder: Path, name: str, options: TrainingOptions, imgsz: int, seed: int = 0) -> Path:
    """Train with checkpoints in `work_NAME`; return the weights `NAME.pt` next to the curve `NAME.csv`."""
    train_detector(
        dataset=dataset,
        weights=folder / f"{name}.pt",
        curve=folder / f"{name}.csv",
        options=options,
        prediction=PredictionOptions(device="cpu"),
        imgsz=imgsz,
        seed=seed,
        threads=1,
        work=folder / f"work_{name}",
    )
    return folder / f"{name}.pt"
