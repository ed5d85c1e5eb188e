"""What detectors of cover photos are trained and tested on: varied twins to train and validate, cover photos to
test.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
import pandas as pd
from pydantic import BaseModel, Field

from polarsim.detect.dataset import PICTURE_COLUMNS
from polarsim.errors import DetectError, about
from polarsim.formats import png, tables
from polarsim.formats.files import write_text, writing_folder
from polarsim.photo import BLACK_LEVEL, HEIGHT, WHITE_LEVEL, WIDTH, PhotoKey
from polarsim.progress import track
from polarsim.randomness import generator

from .strokes import practise

PARTS = ("train", "val", "test")


class CoverOptions(BaseModel, extra="forbid", frozen=True):
    """How twins become the pictures that detectors of cover photos are trained on."""

    val_share: float = Field(0.08, gt=0, lt=1, description="Share of the twins that selects the weights.")
    gamma: tuple[float, float] = Field((1.0, 2.0), description="Range of the exponent of the tone curve.")
    strokes: int = Field(30, ge=0, description="Boxes and digits drawn into a twin and taken out: none to so many.")
    seed: int = Field(0, ge=0, description="Seed of tones, strokes and split.")


def make_cover_dataset(
    *,
    twins: Mapping[int, Path],
    covers: Path,
    test: Sequence[PhotoKey],
    dataset: Path,
    imgsz: int,
    options: CoverOptions,
) -> None:
    """Write a data set as `dataset.make_dataset` does: varied twins to train and validate, cover photos to test.

    Parameters
    ----------
    twins : mapping of terrain to Path
        Folders that `varied` wrote.
    covers : Path
        Folder that `read_covers` wrote.
    test : sequence of PhotoKey
        Cover photos of the test part; labels of these are not written, for nothing here may read them.

    Raises
    ------
    DetectError
        A test photo's terrain is among the twins', or there is no twin.
    """
    both = sorted({key.terrain for key in test} & set(twins))
    if both:
        raise DetectError(f"terrain {both[0]:02d} is to be trained on and to be tested")
    for folder in twins.values():
        if not (folder / "images").is_dir():
            raise DetectError("no varied twins are here", path=folder)
    paths = [path for terrain in sorted(twins) for path in sorted((twins[terrain] / "images").glob("*.png"))]
    if len(paths) < 2:
        raise DetectError(f"{', '.join(map(str, twins.values()))}: {len(paths)} twins, at least 2 are needed")
    order = generator(options.seed, "covers", "val").permutation(len(paths))
    val = set(order[: max(1, round(options.val_share * len(paths)))].tolist())
    rows = [(path.stem, "val" if number in val else "train") for number, path in enumerate(paths)]
    with writing_folder(dataset) as folder:
        for part in PARTS:
            (folder / "images" / part).mkdir(parents=True)
            (folder / "labels" / part).mkdir(parents=True)
        for path, (name, part) in track(list(zip(paths, rows, strict=True)), "twins of covers"):
            with about(path):
                picture = tone_twin(png.read(path), imgsz, options, generator(options.seed, "covers", name))
            png.write(folder / "images" / part / f"{name}.png", picture)
            text = (path.parent.parent / "labels" / f"{name}.txt").read_text(encoding="utf-8")
            write_text(folder / "labels" / part / f"{name}.txt", text)
        for key in test:
            png.write(folder / "images" / "test" / f"{key}.png", shrink(png.read(covers / f"{key}.png"), imgsz))
            rows.append((str(key), "test"))
        tables.write_csv(folder / "pictures.csv", pd.DataFrame(rows, columns=list(PICTURE_COLUMNS)))


def tone_twin(pixels: np.ndarray, imgsz: int, options: CoverOptions, random: np.random.Generator) -> np.ndarray:
    """(h, w) uint8 picture of a twin's 12 bits: a tone curve drawn at random, strokes drawn and taken out, shrunk."""
    light = np.clip((pixels.astype(np.float32) - BLACK_LEVEL) / (WHITE_LEVEL - BLACK_LEVEL), 0, 1)
    picture = np.rint(255 * light ** (1 / random.uniform(*options.gamma))).astype(np.uint8)
    return shrink(practise(picture, options.strokes, random, WIDTH), imgsz)


def shrink(picture: np.ndarray, imgsz: int) -> np.ndarray:
    """(h, w) uint8 averaged to a width of `imgsz`, and the height that a full photo then has."""
    import cv2

    size = (imgsz, round(imgsz * HEIGHT / WIDTH))
    return np.asarray(cv2.resize(picture, size, interpolation=cv2.INTER_AREA))
