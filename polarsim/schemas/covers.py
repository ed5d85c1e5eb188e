"""Tables of detectors evaluated on real photos of held-out terrains."""

from polarsim.schemas.detect import DETECTOR, SEED
from polarsim.schemas.photos import BOX, CONFIDENCE, KIND
from polarsim.schemas.table import INTEGER, NUMBER, TEXT, Columns, Table, interval_columns

# Detectors of a row of cover scores: of a single seed, mean over all seeds, all seeds merged (the latter have no seed).
SINGLE, MEAN, MERGED = "one", "mean", "merged"
# Training data of the detectors: rendered scenes only, or followed by labelled photos of other terrains.
RENDERED, FINE_TUNED = "rendered", "fine_tuned"
NO_SEED = -1

COVER_FOUND = Table(
    "covers/folds/FOLD/seedN/TRAINED/found.parquet",
    "A prediction on a cover photo of the fold",
    Columns("key", TEXT, "", "Key of the cover photo"),
    Columns("width", INTEGER, "px", "Inference width"),
    KIND,
    CONFIDENCE,
    BOX,
)
COVER_SCORES = Table(
    "covers/TRAINED/scores.parquet",
    "A terrain, kind and training",
    Columns(
        "trained",
        TEXT,
        "",
        "Training data: `rendered` scenes only, or `fine_tuned` afterwards on labelled photos of other terrains",
    ),
    Columns("terrain", TEXT, "", "Terrain of the cover photos; `all`: all photos pooled"),
    KIND,
    Columns(
        "detectors",
        TEXT,
        "",
        "Evaluated detectors: `one` of the given seed; `mean` over all seeds, with the same bootstrap replicates of "
        "photos for each seed; `merged`: ensemble of all seeds of a fold",
    ),
    Columns("seed", INTEGER, "", f"{SEED.description}; -1 for `mean` and `merged`"),
    DETECTOR,
    Columns("start", TEXT, "", "Initial weights of the training"),
    Columns("epochs", INTEGER, "count", "Epochs of the training"),
    Columns("folds", INTEGER, "count", "Detectors per seed"),
    Columns("pictures", INTEGER, "count", "Mean number of training images per detector"),
    Columns("images labels", INTEGER, "count", "Cover photos and their labels"),
    interval_columns("map50", "1", "Average precision at IoU 0.5"),
    Columns("map50_95", NUMBER, "1", "Mean of the average precision over IoU 0.5 to 0.95"),
    Columns("iou_mean", NUMBER, "1", "Mean over labels of the largest IoU with a prediction"),
    Columns(
        "calibration_error",
        NUMBER,
        "1",
        "Expected calibration error of boxes with a confidence of at least 0.05: mean difference of the confidence and "
        "the share of correct boxes (IoU 0.5), with each fold calibrated on the other folds; empty for a single fold",
    ),
)
MASK_SCORES = Table(
    "covers/mask_scores.parquet",
    "A region, cover photo and class",
    Columns("key", TEXT, "", "Key of the photo; `all`: pixels of all photos pooled"),
    Columns("region", TEXT, "", "`sand`: without annotated background; `photo`: with background as ground"),
    Columns("kind", TEXT, "", "`ground`, `rock` or `shadow`"),
    Columns("photos", INTEGER, "count", "Photos"),
    Columns("pixels", INTEGER, "px", "Annotated pixels of the class"),
    interval_columns("iou", "1", "IoU of masks and polygons; empty if both lack the class"),
)
TABLES = (COVER_FOUND, COVER_SCORES, MASK_SCORES)
