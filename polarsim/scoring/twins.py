"""Evaluation of twins: rendered boxes against annotations or ground truth, and pixels against photos."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path

import numpy as np
import pandas as pd

from polarsim.errors import FormatError
from polarsim.formats import png
from polarsim.formats.tables import key_columns, write_parquet
from polarsim.photo import BLACK_LEVEL, PhotoKey, by_bracket
from polarsim.run_files.pictures import pictures_at
from polarsim.schemas.evaluation import TWIN_PAIRS
from polarsim.scoring.labels import ALL, against, read_folder, read_true_labels, score_tasks
from polarsim.scoring.metrics import Metric, summary_metric, write_metrics
from polarsim.scoring.options import ScoringOptions
from polarsim.tone import display_white_level, to_8bit

LIT_DN = 40  # minimum signal above the black level; darker pixels are too noisy for a ratio
FULL_DN = 4000  # maximum signal above the black level; brighter pixels are clipped
COMPARED_PHOTOS = 32  # maximum number per terrain, with at most a single photo per exposure bracket
SSIM_WINDOW_PX = 11


@dataclass(frozen=True)
class TwinSimilarity:
    """Similarity of a twin and the photo."""

    lit_px: int  # number of pixels that are lit and not clipped in both images
    log2_twin_over_photo: float  # median over these pixels; NaN without pixels
    log2_difference: float  # median of absolute values
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
    """Write the evaluation of the twins of a terrain, and the table of similarities with a row per twin and photo.

    `boxes` is the folder of rendered boxes, KEY.txt; `truth` a folder of annotated KEY.txt files, or labels.parquet of
    the analog; `twins` the folders of KEY.png by model; `photos` the table photos.parquet, may be empty.
    """
    metrics: list[Metric] = []
    compared: list[dict[str, object]] = []
    if truth is not None:
        rendered = read_folder(boxes, terrain)
        true = read_true_labels(truth, terrain, rendered, options)
        tasks = {key: f"camera {key.camera}" for key in true}
        order = ("camera L", "camera R", ALL)
        for metric in score_tasks(true, rendered, tasks, order, against(truth), options):
            subject = "rendered " + metric.subject.replace(ALL, "all")  # rendered boxes do not depend on seeds
            metrics.append(replace(metric, subject=subject))
    if photos is not None:
        paths = pictures_at(photos)
        for model, folder in sorted(twins.items()):
            common = [key for key in sorted(paths) if key.terrain == terrain and (folder / f"{key}.png").exists()]
            similarities = {
                key: compare_pictures(paths[key], folder / f"{key}.png")
                for key in typical_photos(common, COMPARED_PHOTOS)
            }
            metrics += similarity_metrics(model, list(similarities.values()))
            compared += [{**key_columns(key), "model": model, **asdict(pair)} for key, pair in similarities.items()]
    write_metrics(evaluation, "render", terrain, metrics)
    write_parquet(pairs, pd.DataFrame(compared, columns=list(TWIN_PAIRS.columns)).astype(TWIN_PAIRS.dtypes))


def typical_photos(keys: Sequence[PhotoKey], n: int) -> list[PhotoKey]:
    """Return up to n photos under a Sun lamp, exposed near 256 ms, evenly distributed over exposure brackets."""
    brackets = by_bracket(key for key in keys if key.azimuth != "no").values()
    typical = sorted(min(photos, key=lambda key: (key.stops_off_usual, key)) for photos in brackets)
    if len(typical) <= n:
        return typical
    return [typical[number] for number in np.linspace(0, len(typical) - 1, n).round().astype(int)] if n else []


def compare_pictures(photo_path: Path, twin_path: Path) -> TwinSimilarity:
    """Compare brightness and structure of a twin and the photo."""
    photo, twin = png.read_png(photo_path), png.read_png(twin_path)
    if photo.shape != twin.shape:
        raise FormatError(f"{twin.shape[::-1]} pixels, expected {photo.shape[::-1]} as in the photo", path=twin_path)
    ratio = log_ratio(photo, twin)
    medians = (float(np.median(ratio)), float(np.median(np.abs(ratio)))) if ratio.size else (np.nan, np.nan)
    return TwinSimilarity(ratio.size, *medians, structural_similarity(photo, twin))


def similarity_metrics(model: str, pairs: Sequence[TwinSimilarity]) -> list[Metric]:
    """Return the medians over the twins of a model."""
    metrics: list[Metric] = []
    for name, unit in (("log2_twin_over_photo", "stops"), ("log2_difference", "stops"), ("ssim", "1")):
        values = np.array([getattr(pair, name) for pair in pairs], float)
        metrics += summary_metric(model, name, values, unit, "photos", p90=False)
    return metrics


def log_ratio(photo: np.ndarray, twin: np.ndarray) -> np.ndarray:
    """Return log2(twin / photo), (n,), of the pixels that are lit and not clipped in both images."""
    signals = [picture.astype(float) - BLACK_LEVEL for picture in (photo, twin)]
    good = np.logical_and.reduce([(signal > LIT_DN) & (signal < FULL_DN) for signal in signals])
    return np.log2(signals[1][good] / signals[0][good])


def structural_similarity(photo: np.ndarray, twin: np.ndarray) -> float:
    """Return the mean structural similarity (Wang et al., IEEE Trans. Image Process. 13 (2004) 600), uniform window.

    Both images are tone-mapped with the white point of the photo.
    """
    import cv2

    def mean(picture: np.ndarray) -> np.ndarray:
        return cv2.blur(picture, (SSIM_WINDOW_PX, SSIM_WINDOW_PX), borderType=cv2.BORDER_REFLECT)

    white = display_white_level(photo)
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
