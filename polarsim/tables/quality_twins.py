"""How well twins agree with what they copy: automatic boxes with drawn or true ones, pixels with those of photos."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from scipy.ndimage import uniform_filter

from polarsim.errors import FormatError
from polarsim.formats import png
from polarsim.formats.tables import PHOTO_COLUMNS, read_parquet
from polarsim.photo import BLACK_LEVEL, PhotoKey
from polarsim.tables.options import TablesOptions
from polarsim.tables.quality import Figure, summary, write_quality
from polarsim.tables.quality_labels import ALL, against, read_folder, read_truth, score_tasks
from polarsim.tables.tone import to_8bit, white_of

LIT_DN = 40  # above black: darker pixels hold too much noise for a ratio
FULL_DN = 4000  # above black: brighter ones are clipped
WINDOW = 11  # pixels of the structural similarity's window
TYPICAL_MS = 256  # of all exposures of a photo set the nearest to this one is compared


def score_twins(
    *,
    terrain: int,
    boxes: Path,
    truth: Path | None,
    twins: Mapping[str, Path],
    photos: Path | None,
    quality: Path,
    options: TablesOptions,
) -> None:
    """Write the quality of a terrain's twins.

    Parameters
    ----------
    boxes
        Folder of the automatic boxes, KEY.txt.
    truth
        Folder of hand-drawn KEY.txt files, or the analog's labels.parquet; None where there is none.
    twins
        Folder of the twins, KEY.png, by model.
    photos
        photos.parquet; it may have no row.
    """
    figures: list[Figure] = []
    if truth is not None:
        found = read_folder(boxes, terrain)
        wanted = read_truth(truth, terrain, found, options)
        tasks = {key: f"camera {key.camera}" for key in wanted}
        order = ("camera L", "camera R", ALL)
        for figure in score_tasks(wanted, found, tasks, order, against(truth), options):
            figures.append(_renamed(figure))
    if photos is not None:
        table = read_parquet(photos, PHOTO_COLUMNS)
        paths = {
            PhotoKey.parse(str(key)): Path(str(path)) for key, path in zip(table["key"], table["path"], strict=True)
        }
        for model, folder in sorted(twins.items()):
            there = [key for key in sorted(paths) if key.terrain == terrain and (folder / f"{key}.png").exists()]
            pairs = [(paths[key], folder / f"{key}.png") for key in typical_photos(there, options.compared_photos)]
            figures += compare_pictures(model, pairs)
    write_quality(quality, "render", terrain, figures)


def typical_photos(keys: Sequence[PhotoKey], n: int) -> list[PhotoKey]:
    """Up to n photos under a Sun lamp, of middle exposure, spread evenly over the photo sets."""
    middle: dict[tuple[object, ...], PhotoKey] = {}
    for key in sorted(keys):
        if key.azimuth == "no":
            continue
        best = middle.get(key.photo_set)
        if best is None or _off_typical(key) < _off_typical(best):
            middle[key.photo_set] = key
    found = sorted(middle.values())
    if len(found) <= n:
        return found
    return [found[number] for number in np.linspace(0, len(found) - 1, n).round().astype(int)] if n else []


def compare_pictures(model: str, pairs: Sequence[tuple[Path, Path]]) -> list[Figure]:
    """Brightness and structure of twins beside their photos: (photo, twin) paths."""
    ratios, likeness = [], []
    for photo_path, twin_path in pairs:
        photo, twin = png.read(photo_path), png.read(twin_path)
        if photo.shape != twin.shape:
            raise FormatError(f"{twin_path}: {twin.shape[::-1]} pixels, its photo has {photo.shape[::-1]}")
        ratio = log_ratio(photo, twin)
        if ratio.size:
            ratios.append((float(np.median(ratio)), float(np.median(np.abs(ratio)))))
        likeness.append(similarity(photo, twin))
    found = np.array(ratios).reshape(-1, 2)
    figures = summary(model, "log2_twin_over_photo", found[:, 0], "stops", "photos", p90=False)
    figures += summary(model, "log2_difference", found[:, 1], "stops", "photos", p90=False)
    return figures + summary(model, "ssim", np.array(likeness), "1", "photos", p90=False)


def log_ratio(photo: np.ndarray, twin: np.ndarray) -> np.ndarray:
    """log2(twin / photo) of the pixels that are lit and not clipped in both, (n,)."""
    signals = [picture.astype(float) - BLACK_LEVEL for picture in (photo, twin)]
    good = np.logical_and.reduce([(signal > LIT_DN) & (signal < FULL_DN) for signal in signals])
    return np.log2(signals[1][good] / signals[0][good])


def similarity(photo: np.ndarray, twin: np.ndarray) -> float:
    """Mean structural similarity (Wang et al., IEEE Trans. Image Process. 13 (2004) 600), flat window, tone-mapped.

    Both are shown with the photo's white.
    """
    white = white_of(photo)
    first, second = (to_8bit(picture, white)[..., 0].astype(float) for picture in (photo, twin))
    mean1, mean2 = uniform_filter(first, WINDOW), uniform_filter(second, WINDOW)
    variance1 = uniform_filter(first * first, WINDOW) - mean1**2
    variance2 = uniform_filter(second * second, WINDOW) - mean2**2
    covariance = uniform_filter(first * second, WINDOW) - mean1 * mean2
    c1, c2 = (0.01 * 255) ** 2, (0.03 * 255) ** 2
    value = (
        (2 * mean1 * mean2 + c1) * (2 * covariance + c2) / ((mean1**2 + mean2**2 + c1) * (variance1 + variance2 + c2))
    )
    return float(value.mean())


def _off_typical(key: PhotoKey) -> float:
    return abs(float(np.log2(key.exposure_ms / TYPICAL_MS)))


def _renamed(figure: Figure) -> Figure:
    """Automatic boxes know no seeds: all photos count."""
    subject = "automatic " + figure.subject.replace(ALL, "all")
    return Figure(subject, figure.figure, figure.value, figure.unit, figure.n, figure.against)
