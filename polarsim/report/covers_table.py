"""Tables of detectors and of class masks on real cover photos of held-out terrains."""

from __future__ import annotations

from pathlib import Path

import pandas as pd

from polarsim.formats.tables import read_parquet
from polarsim.photo import BOX_CLASSES
from polarsim.report.layout import interval_text, write_table
from polarsim.run_files.class_masks import CLASSES
from polarsim.schemas.covers import COVER_SCORES, FINE_TUNED, MASK_SCORES, MEAN, MERGED, RENDERED, SINGLE
from polarsim.wording import counted

CAPTION = "Detectors trained on random scenes, tested on real cover photos of held-out terrains: value [95 % interval]."
NOTES = (
    "IOU_mean: mean over labels of the largest IoU with any prediction. Row of a terrain: the detector trained "
    "without the rocks of this terrain. Row all: all photos pooled, each with the detector of the terrain.",
    "Calibration error: expected calibration error of confidences of at least 0.05 (a box is correct at IoU 0.5); the "
    "boxes of each fold are calibrated with the boxes of all other folds.",
    "Intervals: bootstrap over photos. They do not include the variation between trainings or machines.",
)
SEVERAL = (
    "Mean: mean metric over seeds. Merged: weighted boxes fusion of the detectors of all seeds; a box predicted by "
    "only 1 of n detectors gets 1/n of the confidence."
)
PHOTOS_TOO = (
    "Scenes, photos: fine-tuned for {epochs} of {pictures} images: scenes, and windows of the labelled cover "
    "photos of all terrains outside the tested fold (same sandbox and walls)."
)
TRAINED_ON = {RENDERED: "scenes", FINE_TUNED: "scenes, photos"}
MASKS_CAPTION = (
    "IoU of class masks with annotated polygons, real cover photos of held-out terrains: value [95 % interval]."
)
MASKS_NOTES = (
    "Region sand: pixels annotated as ground, rock or shadow. Region photo: all pixels; background counts as ground. "
    "Pixels of all photos are pooled. No value: the class is missing in masks and polygons.",
    "Annotators copy unlit rocks from other exposures and mark shade from relief and walls as ground.",
    "Intervals: bootstrap over photos. They do not include the variation between trainings or machines.",
)


def tabulate_covers(*, scores: list[Path], stem: Path, origin: dict[str, str]) -> None:
    """Write tables/covers.{csv,md,tex,parquet} from the scores of the covers stage, a file per training method."""
    table = pd.concat([read_parquet(path, COVER_SCORES.columns) for path in scores], ignore_index=True)
    first = table.iloc[0]
    trained = (
        f"Detector {first['detector']} from {first['start']}, {counted(first['epochs'], 'epoch')} of "
        f"{first['pictures']} images of scenes, {first['folds']} folds."
    )
    notes = [*NOTES, trained]
    for photos_too in table[table["trained"] == FINE_TUNED].head(1).to_dict("records"):
        notes.append(PHOTOS_TOO.format_map(photos_too | {"epochs": counted(photos_too["epochs"], "epoch")}))
    notes += [SEVERAL] if _are_several(table) else []
    write_table(stem, table, CAPTION, layout=tidy_covers(table), notes=notes, origin=origin)


def tidy_covers(table: pd.DataFrame) -> pd.DataFrame:
    """Return one row for all cover photos and one per terrain, for each training method.

    With several seeds there is a row for each seed, for the mean and for the merged detector.
    """
    rows = [
        _row(part, several=_are_several(table), fine_tuned=_are_fine_tuned(table))
        for _, of_terrain in table.groupby("terrain", sort=False)
        for _, part in of_terrain.groupby(["trained", "detectors", "seed"], sort=False)
    ]
    return pd.DataFrame(rows)


def _row(part: pd.DataFrame, several: bool, fine_tuned: bool) -> dict[str, object]:
    first = part.iloc[0]
    row: dict[str, object] = {"terrain": first["terrain"]}
    if fine_tuned:
        row["trained on"] = TRAINED_ON[first["trained"]]
    if several:
        row["detectors"] = {SINGLE: f"seed {first['seed']}", MEAN: "mean", MERGED: "merged"}[first["detectors"]]
    row["photos"] = int(first["images"])
    for kind in BOX_CLASSES:
        scores = part[part["kind"] == kind]
        row[f"{kind}s"] = int(scores["labels"].iloc[0]) if len(scores) else 0
        row[f"{kind}s, mAP@0.5"] = interval_text(scores.iloc[0], "map50") if len(scores) else ""
    rocks = part[part["kind"] == BOX_CLASSES[0]]
    row["rocks, IOU_mean"] = float(rocks["iou_mean"].mean())
    row["rocks, calibration error"] = float(rocks["calibration_error"].mean())
    return row


def _are_several(table: pd.DataFrame) -> bool:
    return bool((table["detectors"] != SINGLE).any())


def _are_fine_tuned(table: pd.DataFrame) -> bool:
    return bool((table["trained"] == FINE_TUNED).any())


def tabulate_masks(*, scores: Path, stem: Path, origin: dict[str, str]) -> None:
    """Write tables/masks.{csv,md,tex,parquet} from the scores of masks."""
    table = read_parquet(scores, MASK_SCORES.columns)
    write_table(stem, table, MASKS_CAPTION, layout=tidy_masks(table), notes=MASKS_NOTES, origin=origin)


def tidy_masks(table: pd.DataFrame) -> pd.DataFrame:
    """Return a row per region and photo, and a row per region for all photos."""
    rows = []
    for (region, key), part in table.groupby(["region", "key"], sort=False):
        row: dict[str, object] = {"region": region, "photo": key, "photos": int(part["photos"].iloc[0])}
        for kind in CLASSES:
            row[kind] = interval_text(part[part["kind"] == kind].iloc[0], "iou")
        rows.append(row)
    return pd.DataFrame(rows)
