"""The published cover photos as a small real test: strokes taken out, paired with the boxes that people drew."""

from __future__ import annotations

import logging
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
import pandas as pd
from pydantic import BaseModel, Field

from polarsim.detect import metrics
from polarsim.detect.dataset import BOX_COLUMNS, PICTURE_COLUMNS
from polarsim.detect.strokes import drawn_boxes, erase_strokes, find_strokes, practise
from polarsim.errors import DetectError, about
from polarsim.formats import png, release, tables, yolo
from polarsim.formats.files import write_text, writing_folder
from polarsim.geometry import boxes
from polarsim.photo import BLACK_LEVEL, BOX_CLASSES, HEIGHT, ROCK, WHITE_LEVEL, WIDTH, PhotoKey
from polarsim.progress import track
from polarsim.randomness import generator

SOURCE = "drawn"  # of labels that people made
PARTS = ("train", "val", "test")
PAIRING_COLUMNS = ("key", "shown", "light", "azimuth", "camera", "drawn", "labels", "matched", "score")
log = logging.getLogger("polarsim")


class CoverOptions(BaseModel, extra="forbid", frozen=True):
    """How twins become the pictures that judges of cover photos are trained on."""

    val_share: float = Field(0.08, gt=0, lt=1, description="Share of the twins that selects the weights.")
    gamma: tuple[float, float] = Field((1.0, 2.0), description="Range of the exponent of the tone curve.")
    strokes: int = Field(30, ge=0, description="Boxes and digits drawn into a twin and taken out: none to so many.")
    seed: int = Field(0, ge=0, description="Seed of tones, strokes and split.")


def pair_covers(root: Path, keys: Sequence[PhotoKey], pairing: Path) -> None:
    """Write how well the boxes drawn into each cover photo fit the labels of every photo of its position.

    A row a cover photo and photo set (`shown`: the one that the keys name): boxes drawn, labels of rocks, pairs of the
    best assignment that overlap at all, and `score`, the summed IoU of these over the larger of the two numbers.
    Exposures of a photo set share their labels, so the named key's stands for all.
    """
    rows = []
    for key in keys:
        drawn = drawn_boxes(find_strokes(read_cover(root, key)))
        for other, path in release.label_files(root, key.terrain).items():
            if other.position != key.position or other.exposure_ms != key.exposure_ms:
                continue
            classes, corners = yolo.read_boxes(path)
            rocks = corners[classes == BOX_CLASSES.index(ROCK)]
            overlap = boxes.iou(drawn, rocks) if len(drawn) and len(rocks) else np.zeros((len(drawn), len(rocks)))
            first, second = boxes.match_sum(overlap)
            total = overlap[first, second]
            most = max(len(drawn), len(rocks), 1)
            rows.append(
                (str(key), other == key, other.light, other.azimuth, other.camera, len(drawn), len(rocks),
                 int((total > 0).sum()), total.sum() / most)
            )  # fmt: skip
    tables.write_csv(pairing, pd.DataFrame(rows, columns=list(PAIRING_COLUMNS)).round({"score": 3}))


def read_cover(root: Path, key: PhotoKey) -> np.ndarray:
    """(h, w, 3) uint8 cover photo of a key's position.

    Raises
    ------
    DetectError
        There is none, or it is no colour picture of a photo's size.
    """
    path = release.cover_photos(root, key.terrain).get(key.position)
    if path is None:
        raise DetectError(f"no cover photo of terrain {key.terrain:02d}, position {key.position}", path=root)
    picture = png.read(path)
    if picture.dtype != np.uint8 or picture.ndim != 3 or picture.shape[:2] != (HEIGHT, WIDTH):
        raise DetectError(
            f"shape {picture.shape} {picture.dtype}, expected {HEIGHT} x {WIDTH} in colour, 8 bits", path=path
        )
    return picture[..., :3]


def read_covers(*, root: Path, keys: Sequence[PhotoKey], pictures: Path, labels: Path) -> None:
    """Write each cover photo without its strokes as `KEY.png` (8 bits, full size), and the label table of their keys.

    Raises
    ------
    PolarsimError
        A cover photo or label file is missing or broken.
    """
    rows = []
    with writing_folder(pictures) as folder:
        for key in keys:
            png.write(folder / f"{key}.png", erase_strokes(read_cover(root, key)))
            path = release.label_files(root, key.terrain).get(key)
            if path is None:
                raise DetectError(f"no label file {key}.txt", path=root)
            classes, corners = yolo.read_boxes(path)
            facts = {"key": str(key), **{name: getattr(key, name) for name in (
                "terrain", "position", "light", "azimuth", "camera", "exposure_ms"
            )}}  # fmt: skip
            for kind, box in zip(classes, corners, strict=True):
                rows.append(
                    facts
                    | {"kind": BOX_CLASSES[kind], "rock": -1, "source": SOURCE, "confidence": 1.0}
                    | dict(zip(BOX_COLUMNS, box.tolist(), strict=True))
                )
    tables.write_parquet(labels, tables.label_table(rows))


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
        Folders that `render.varied` wrote.
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


def cover_figures(
    labels: pd.DataFrame, predictions: pd.DataFrame, keys: Sequence[str], *, seed: int, resamples: int
) -> pd.DataFrame:
    """Average precision of each labelled kind, photos pooled, with 95 % intervals of a bootstrap over the photos.

    Columns: kind, images, labels, map50, map50_low, map50_high, map50_95, iou_mean (every prediction counts).
    """
    rows = []
    labels = labels[labels["key"].isin(keys)]
    for kind in (kind for kind in BOX_CLASSES if (labels["kind"] == kind).any()):
        truth = _by_photo(labels[labels["kind"] == kind], BOX_COLUMNS, keys)
        found = _by_photo(predictions[predictions["kind"] == kind], (*BOX_COLUMNS, "confidence"), keys)

        def precision(
            chosen: np.ndarray, truth: list[np.ndarray] = truth, found: list[np.ndarray] = found
        ) -> np.ndarray:
            return metrics.average_precision(
                [truth[n] for n in chosen], [found[n][:, :4] for n in chosen], [found[n][:, 4] for n in chosen]
            )

        whole = precision(np.arange(len(keys)))
        random = generator(seed, "covers", "bootstrap", kind)
        drawn = [precision(random.integers(len(keys), size=len(keys)))[0] for _ in range(resamples)]
        low, high = np.nanpercentile(drawn, [2.5, 97.5])
        best = np.concatenate([metrics.best_overlap(t, f[:, :4]) for t, f in zip(truth, found, strict=True)])
        rows.append((kind, len(keys), len(best), whole[0], low, high, whole.mean(), best.mean()))
    names = ["kind", "images", "labels", "map50", "map50_low", "map50_high", "map50_95", "iou_mean"]
    return pd.DataFrame(rows, columns=names)


def _by_photo(table: pd.DataFrame, columns: Sequence[str], keys: Sequence[str]) -> list[np.ndarray]:
    found = {str(key): rows.to_numpy(float) for key, rows in table.groupby("key")[list(columns)]}
    return [found.get(key, np.zeros((0, len(columns)))) for key in keys]
