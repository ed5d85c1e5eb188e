"""How well twins agree with what they copy: rendered boxes with annotated or true ones, pixels with those of photos."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from itertools import groupby
from pathlib import Path

import numpy as np
import pandas as pd

from polarsim.errors import FormatError
from polarsim.formats import png
from polarsim.formats.tables import key_columns, write_parquet
from polarsim.photo import BLACK_LEVEL, PhotoKey
from polarsim.run_files.pictures import pictures_at
from polarsim.schemas.evaluation import TWIN_PAIRS
from polarsim.scoring.labels import ALL, against, read_folder, read_truth, score_tasks
from polarsim.scoring.metrics import Metric, summary, write_metrics
from polarsim.scoring.options import ScoringOptions
from polarsim.tone import to_8bit, white_of

LIT_DN = 40  # above black: darker pixels hold too much noise for a ratio
FULL_DN = 4000  # above black: brighter ones are clipped
COMPARED_PHOTOS = 32  # of a terrain, one an exposure bracket at most
WINDOW = 11  # pixels of the structural similarity's window


@dataclass(frozen=True)
class Likeness:
    """How alike a twin and its photo are."""

    lit_px: int  # pixels that are lit and not clipped in both
    log2_twin_over_photo: float  # median over them; NaN without any
    log2_difference: float  # median of the absolute values
    ssim: float


def score_twins(
    *,
    terrain: int,
    boxes: Path,
    truth: Path | None,
    twins: Mapping[str, Path],
    photos: Path | None,
    evaluation: Path,
    pairs: Path,
    options: ScoringOptions,
) -> None:
    """Write the evaluation of a terrain's twins, and how alike each twin and its photo are, a row a pair.

    Parameters
    ----------
    boxes
        Folder of the rendered ground-truth boxes, KEY.txt.
    truth
        Folder of hand-annotated KEY.txt files, or the analog's labels.parquet; None where there is none.
    twins
        Folder of the twins, KEY.png, by model.
    photos
        photos.parquet; it may have no row.
    evaluation, pairs
        What to write: metrics CSV; Parquet with the columns of `TWIN_PAIRS`.
    """
    metrics: list[Metric] = []
    compared: list[dict[str, object]] = []
    if truth is not None:
        found = read_folder(boxes, terrain)
        wanted = read_truth(truth, terrain, found, options)
        tasks = {key: f"camera {key.camera}" for key in wanted}
        order = ("camera L", "camera R", ALL)
        for metric in score_tasks(wanted, found, tasks, order, against(truth), options):
            subject = "rendered " + metric.subject.replace(ALL, "all")  # they know no seeds: all photos count
            metrics.append(replace(metric, subject=subject))
    if photos is not None:
        paths = pictures_at(photos)
        for model, folder in sorted(twins.items()):
            there = [key for key in sorted(paths) if key.terrain == terrain and (folder / f"{key}.png").exists()]
            alike = {
                key: compare_pictures(paths[key], folder / f"{key}.png")
                for key in typical_photos(there, COMPARED_PHOTOS)
            }
            metrics += likeness_metrics(model, list(alike.values()))
            compared += [{**key_columns(key), "model": model, **asdict(likeness)} for key, likeness in alike.items()]
    write_metrics(evaluation, "render", terrain, metrics)
    write_parquet(pairs, pd.DataFrame(compared, columns=list(TWIN_PAIRS.columns)).astype(TWIN_PAIRS.dtypes))


def typical_photos(keys: Sequence[PhotoKey], n: int) -> list[PhotoKey]:
    """Up to n photos under a Sun lamp, of middle exposure, spread evenly over the exposure brackets."""
    sunlit = sorted((key for key in keys if key.azimuth != "no"), key=lambda key: (key.bracket, key))
    brackets = groupby(sunlit, key=lambda key: key.bracket)
    found = sorted(min(own, key=lambda key: (key.stops_off_usual, key)) for _, own in brackets)
    if len(found) <= n:
        return found
    return [found[number] for number in np.linspace(0, len(found) - 1, n).round().astype(int)] if n else []


def compare_pictures(photo_path: Path, twin_path: Path) -> Likeness:
    """Brightness and structure of a twin beside its photo.

    Raises
    ------
    FormatError
        A picture cannot be read, or they differ in size.
    """
    photo, twin = png.read(photo_path), png.read(twin_path)
    if photo.shape != twin.shape:
        raise FormatError(f"{twin.shape[::-1]} pixels, its photo has {photo.shape[::-1]}", path=twin_path)
    ratio = log_ratio(photo, twin)
    medians = (float(np.median(ratio)), float(np.median(np.abs(ratio)))) if ratio.size else (np.nan, np.nan)
    return Likeness(ratio.size, *medians, similarity(photo, twin))


def likeness_metrics(model: str, found: Sequence[Likeness]) -> list[Metric]:
    """Medians over the pairs of a model."""
    metrics: list[Metric] = []
    for name, unit in (("log2_twin_over_photo", "stops"), ("log2_difference", "stops"), ("ssim", "1")):
        values = np.array([getattr(likeness, name) for likeness in found], float)
        metrics += summary(model, name, values, unit, "photos", p90=False)
    return metrics


def log_ratio(photo: np.ndarray, twin: np.ndarray) -> np.ndarray:
    """log2(twin / photo) of the pixels that are lit and not clipped in both, (n,)."""
    signals = [picture.astype(float) - BLACK_LEVEL for picture in (photo, twin)]
    good = np.logical_and.reduce([(signal > LIT_DN) & (signal < FULL_DN) for signal in signals])
    return np.log2(signals[1][good] / signals[0][good])


def similarity(photo: np.ndarray, twin: np.ndarray) -> float:
    """Mean structural similarity (Wang et al., IEEE Trans. Image Process. 13 (2004) 600), flat window, tone-mapped.

    Both are shown with the photo's white.
    """
    import cv2

    def mean(picture: np.ndarray) -> np.ndarray:
        return cv2.blur(picture, (WINDOW, WINDOW), borderType=cv2.BORDER_REFLECT)

    white = white_of(photo)
    first, second = (to_8bit(picture, white)[..., 0].astype(np.float32) for picture in (photo, twin))
    mean1, mean2 = mean(first), mean(second)
    variance1 = mean(first * first) - mean1**2
    variance2 = mean(second * second) - mean2**2
    covariance = mean(first * second) - mean1 * mean2
    c1, c2 = (0.01 * 255) ** 2, (0.03 * 255) ** 2
    value = (
        (2 * mean1 * mean2 + c1) * (2 * covariance + c2) / ((mean1**2 + mean2**2 + c1) * (variance1 + variance2 + c2))
    )
    return float(value.mean())
