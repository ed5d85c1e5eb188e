"""Tables of detectors on real photos of terrains left out."""

from polarsim.schemas.detect import DETECTOR, SEED
from polarsim.schemas.photos import BOX, CONFIDENCE, KIND
from polarsim.schemas.table import INTEGER, NUMBER, TEXT, Columns, Table, with_interval

# Whose metrics a row of cover scores has: one training's, the mean of all, those of all merged. These two have no seed.
ONE, MEAN, MERGED = "one", "mean", "merged"
# On what these detectors were trained: scenes alone, or labelled photos of other terrains after them.
RENDERED, FINE_TUNED = "rendered", "fine_tuned"
NO_SEED = -1

COVER_FOUND = Table(
    "covers/folds/FOLD/seedN/TRAINED/found.parquet",
    "A prediction on a cover photo of the fold",
    Columns("key", TEXT, "", "Key of the cover photo"),
    Columns("width", INTEGER, "px", "Width of the picture in which it was found"),
    KIND,
    CONFIDENCE,
    BOX,
)
COVER_SCORES = Table(
    "covers/TRAINED/scores.parquet",
    "A terrain, kind and training",
    Columns(
        "trained", TEXT, "", "`rendered`: on scenes only; `fine_tuned`: after that on labelled photos of other terrains"
    ),
    Columns("terrain", TEXT, "", "Terrain of the cover photos; `all`: all photos pooled"),
    KIND,
    Columns(
        "detectors",
        TEXT,
        "",
        "`one` training of that seed; the `mean` over all seeds, whose interval resamples the same photos for each; "
        "each fold's detectors of all seeds `merged` as one detector",
    ),
    Columns("seed", INTEGER, "", f"{SEED.description}; -1 for `mean` and `merged`"),
    DETECTOR,
    Columns("start", TEXT, "", "Weights that the training started from"),
    Columns("epochs", INTEGER, "count", "Epochs of the training"),
    Columns("folds", INTEGER, "count", "Detectors of a seed"),
    Columns("pictures", INTEGER, "count", "Mean number of pictures that each was trained on"),
    Columns("images labels", INTEGER, "count", "Cover photos and their labels"),
    with_interval("map50", "1", "Average precision at IoU 0.5"),
    Columns("map50_95", NUMBER, "1", "Mean of the average precision over IoU 0.5 to 0.95"),
    Columns("iou_mean", NUMBER, "1", "Mean over labels of the largest IoU with a prediction"),
    Columns(
        "calibration_error",
        NUMBER,
        "1",
        "Expected calibration error of boxes with a confidence of 0.05 or more: mean distance of the confidence from "
        "the share that is right (IoU 0.5), each fold calibrated by all other folds; empty with one fold",
    ),
)
MASK_SCORES = Table(
    "covers/mask_scores.parquet",
    "A region, cover photo and class",
    Columns("key", TEXT, "", "Key of the photo; `all`: pixels of all photos pooled"),
    Columns("region", TEXT, "", "`sand`: without what people painted as background; `photo`: with it, as ground"),
    Columns("kind", TEXT, "", "`ground`, `rock` or `shadow`"),
    Columns("photos", INTEGER, "count", "Photos"),
    Columns("pixels", INTEGER, "px", "Pixels that people painted with this class"),
    with_interval("iou", "1", "IoU of mask and polygons; empty where neither has the class"),
)
TABLES = (COVER_FOUND, COVER_SCORES, MASK_SCORES)
