"""Evaluation of propagated labels against annotations or ground truth, by propagation task."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path

import pandas as pd

from polarsim.formats import release
from polarsim.formats.tables import LABEL_COLUMNS, read_parquet, write_parquet
from polarsim.photo import BOX_CLASSES, SHADOW, PhotoKey, Terrain
from polarsim.scoring.label_pairs import labels_of_photos, pair_labels, shadows_annotated
from polarsim.scoring.metrics import BOX_METRICS, Against, Metric, write_metrics
from polarsim.scoring.reliability import ANY_SOURCE, binned_calibration_error, brier_score, reliability_table
from polarsim.scoring.score import MatchCounts, PhotoLabels, box_reader, count_photo, read_sound
from polarsim.site import Site

EXPOSURES, LIGHT, CAMERA = "other exposures", "light on", "Left to Right"
AZIMUTH, NO_SUN, POSITION, ALL = "another azimuth", "no Sun", "position without seed", "all but seeds"
PROPAGATION_TASKS = (EXPOSURES, LIGHT, CAMERA, AZIMUTH, NO_SUN, POSITION, ALL)
ANNOTATED = "shadow, where annotated"  # photos with a true shadow: shadows are not annotated at short exposures

# Smaller and fainter objects of the analog are not annotated in NASA's photos.
MIN_VISIBLE_PX, MIN_SHADOW_WIDTH_PX = 12, 3
MIN_CONTRAST_DN = 10  # in any photo of the exposure bracket


def score_labels(
    *,
    site: Site,
    terrain: Terrain,
    keys: Sequence[PhotoKey],
    table: Path,
    truth: Path,
    seeds: Path,
    evaluation: Path,
    pairs: Path,
) -> None:
    """Write the evaluation of the labels of a terrain, and the table of matches with true boxes.

    `keys` are the labelled photos; without a row in `table`, a photo has no visible object. `truth` is a folder of
    annotated KEY.txt files (of a terrain, or the root of a release), or labels.parquet of the analog. Photos of seeds
    are not scored.
    """
    labels, usual = read_parquet(table, LABEL_COLUMNS), site.usual_exposure_ms
    predicted = dict.fromkeys(keys, PhotoLabels.none()) | labels_of_photos(labels)
    true = read_true_labels(truth, terrain, predicted, site.images.size)
    seed_keys = set(release.key_files(seeds).files)
    tasks = {key: task_of(key, seed_keys) for key in true}
    metrics = [Metric("seeds", "photos_annotated", len(seed_keys), "photos", len(predicted), "own")]
    metrics += score_tasks(true, predicted, tasks, PROPAGATION_TASKS, against(truth), usual)
    unlabelled = len([key for key, task in tasks.items() if task is not None and key not in predicted])
    metrics.append(Metric("photos with truth", "without_label_file", unlabelled, "photos", len(true), against(truth)))
    compared = {key: boxes for key, boxes in true.items() if key in predicted}
    paired = pair_labels(compared, labels, tasks, against(truth), usual)
    write_parquet(pairs, paired)
    write_metrics(evaluation, "labels", terrain, metrics + confidence_metrics(paired, against(truth)))


def task_of(key: PhotoKey, seeds: Iterable[PhotoKey]) -> str | None:
    """Return the propagation task of a photo for given seeds; None for the photo of a seed.

    The task is the most difficult required step: position, no Sun, azimuth, Left to Right, light on, exposure.
    """
    near = [seed for seed in seeds if seed.station == key.station]
    if key in near:
        return None
    if not near:
        return POSITION
    if not key.has_sun and all(seed.has_sun for seed in near):
        return NO_SUN
    near = [seed for seed in near if seed.azimuth == key.azimuth]
    if not near:
        return AZIMUTH
    if all(seed.camera != key.camera for seed in near):
        return CAMERA
    return LIGHT if all(seed.light != key.light for seed in near) else EXPOSURES


def score_tasks(
    true: Mapping[PhotoKey, PhotoLabels],
    predicted: Mapping[PhotoKey, PhotoLabels],
    tasks: Mapping[PhotoKey, str | None],
    order: Iterable[str],
    against: Against,
    usual_exposure_ms: int,
) -> list[Metric]:
    """Return precision, recall, F1 and mIoU by class and task, pooled over the common photos."""
    total: dict[tuple[str, str], MatchCounts] = {}
    for key in sorted(set(true) & set(predicted)):
        task = tasks[key]
        if task is None:
            continue
        for kind, counts in count_photo(true[key], predicted[key]).items():
            annotated = kind == SHADOW and shadows_annotated(key, counts.tp + counts.fn, against, usual_exposure_ms)
            for name in [kind, ANNOTATED] if annotated else [kind]:
                for part in (task, ALL):
                    total[name, part] = total.get((name, part), MatchCounts()) + counts
    metrics = []
    for kind in (*BOX_CLASSES, ANNOTATED):
        for task in order:
            if (kind, task) in total:
                metrics += box_metrics(f"{kind}: {task}", total[kind, task], against)
    return metrics


def read_folder(folder: Path, terrain: Terrain, size: tuple[int, int]) -> dict[PhotoKey, PhotoLabels]:
    """Read the labels of a terrain in a folder of KEY.txt; invalid lines are errors. `size` of photos: px."""
    files, read = release.key_files(folder).files, box_reader(size)
    return {key: read(path) for key, path in files.items() if key.terrain == terrain}


def read_true_labels(
    truth: Path, terrain: Terrain, labelled: Iterable[PhotoKey], size: tuple[int, int]
) -> dict[PhotoKey, PhotoLabels]:
    """Read the true labels by photo from annotated files or from the label table of the analog.

    A photo without annotated file has no truth. The table of the analog is complete: a photo without row has no object.
    """
    if not truth.is_file():
        folder = release.label_folder(truth, terrain) if (truth / release.BOXES).is_dir() else truth
        return read_sound_boxes(folder, terrain, size)
    table = read_parquet(truth, LABEL_COLUMNS)
    labels_of = labels_of_photos(visible(table[table["terrain"] == terrain]))
    return {key: labels_of.get(key, PhotoLabels.none()) for key in sorted({*labels_of, *labelled})}


def visible(truth: pd.DataFrame) -> pd.DataFrame:
    """Return the true labels that an annotator could see: large enough, with contrast in a photo of the bracket.

    Annotators copy labels to all exposures of an exposure bracket, so that contrast in a single exposure is enough. A
    shadow also needs a minimum width: the box of a line of dark pixels around the foot of a rock is as large as the
    rock, but such lines are not annotated. The columns `visible_px`, `width_px` and `contrast` (DN) may be missing.
    """
    if "visible_px" in truth.columns:
        truth = truth[truth["visible_px"] >= MIN_VISIBLE_PX]
    if "width_px" in truth.columns:
        truth = truth[(truth["kind"] != SHADOW) | (truth["width_px"] >= MIN_SHADOW_WIDTH_PX)]
    if "contrast" in truth.columns:
        object_columns = ["terrain", "position", "light", "azimuth", "camera", "kind", "rock"]
        contrast = truth["contrast"].abs().groupby([truth[name] for name in object_columns]).transform("max")
        truth = truth[contrast >= MIN_CONTRAST_DN]
    return truth


def read_sound_boxes(folder: Path, terrain: Terrain, size: tuple[int, int]) -> dict[PhotoKey, PhotoLabels]:
    """Read labels as `read_folder` does, but skip invalid files with a warning: the release has such a file."""
    files = release.key_files(folder).files
    return read_sound({key: path for key, path in files.items() if key.terrain == terrain}, box_reader(size))[0]


def against(truth: Path) -> Against:
    """Return the kind of the reference: the table of the analog is truth, annotated files are labels."""
    return "truth" if truth.is_file() else "labels"


def confidence_metrics(pairs: pd.DataFrame, against: Against) -> list[Metric]:
    """Return the calibration error and Brier score of the confidences of labels by class."""
    table = reliability_table(pairs)
    metrics = []
    for kind in BOX_CLASSES:
        bins = table[(table["kind"] == kind) & (table["label_source"] == ANY_SOURCE)]
        if len(bins):
            n = round(bins["labels"].sum())
            for name, value in (("ece", binned_calibration_error(bins)), ("brier", brier_score(bins))):
                metrics.append(Metric(f"{kind}: confidence", name, value, "1", n, against))
    return metrics


def box_metrics(subject: str, counts: MatchCounts, against: Against) -> list[Metric]:
    """Return precision, recall, F1 and mean IoU; NaN for a division by zero."""
    sizes = dict.fromkeys(BOX_METRICS, counts.tp + counts.fn) | {"precision": counts.tp + counts.fp}
    values = {name: float("nan") if value is None else float(value) for name, value in counts.metrics().items()}
    return [Metric(subject, name, values[name], "1", n, against) for name, n in sizes.items()]
