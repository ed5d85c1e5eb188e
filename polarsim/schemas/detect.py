"""Tables of the stage detect, and of the ablation of the gap."""

from polarsim.schemas.photos import BOX, CONFIDENCE, KEY, KEY_NAME, KIND, ROCK
from polarsim.schemas.table import BOOL, INTEGER, NUMBER, TEXT, Columns, Table, interval_columns

TRAINED = Columns("trained", TEXT, "", "Training domain of the detector")
SIDES = (TRAINED, Columns("evaluated", TEXT, "", "Domain of the test photos"))
PAIR = (TRAINED, Columns("first second", TEXT, "", "Compared domains"))
ANY_KIND = Columns("kind", TEXT, "", "`rock`, `shadow`, or `all`: mean of both")
SPLIT = Columns("split", TEXT, "", "Unit of the split of photos: `photo` key, `view`, `position` or `terrain`")
SEED = Columns("seed", INTEGER, "", "Seed of the training")
DETECTOR = Columns("detector", TEXT, "", "Model of the detector")
TRAINING = (
    DETECTOR,
    Columns("start", TEXT, "", "Initial weights of the training"),
    Columns("epochs", INTEGER, "count", "Epochs of the training"),
    Columns("imgsz", INTEGER, "px", "Longer side of the images in training and test"),
)
UNITS = Columns("units", INTEGER, "count", "Resampling units of the bootstrap")
UNIT = Columns("unit", TEXT, "", "Resampling unit: `view` (terrain, position, camera) or `photo`")
IMAGES = Columns("images", INTEGER, "count", "Test photos")
LABELS_COUNT = Columns("labels", INTEGER, "count", "Labels of the test photos")
PAIRS = Columns("pairs", INTEGER, "count", "Objects labelled in both domains: same photo key, same rock id")
METRICS = (
    interval_columns("map50", "1", "Average precision at IoU 0.5"),
    interval_columns("map50_95", "1", "Mean of the average precision over IoU 0.5 to 0.95"),
    interval_columns("iou_mean", "1", "Mean over labelled rocks of the largest IoU with a prediction; 0 if undetected"),
)
IPDS = (
    Columns("ipd", NUMBER, "1", "Absolute value of the mean difference of IoU, the formula of the paper"),
    Columns("ipd_abs", NUMBER, "1", "Mean of the absolute differences of IoU"),
    Columns("ipd_low ipd_high ipd_abs_low ipd_abs_high", NUMBER, "1", "95 % intervals; empty for a single unit"),
)
UNDETECTED = Columns(
    "undetected", TEXT, "", "Treatment of labelled rocks that no prediction overlaps: `zero` (IoU 0) or `left_out`"
)
UNPAIRED = Columns("unpaired", TEXT, "", "Treatment of rocks labelled in a single domain: `zero` or `left_out`")
MIN_CONFIDENCE = Columns("confidence", NUMBER, "1", "Minimum confidence of a prediction")
PERFORMANCES = (
    Columns("photos", INTEGER, "count", "Photos of the rock in both domains"),
    Columns("iou_first iou_second", NUMBER, "1", "Mean IoU over these photos in each domain"),
    Columns("difference", NUMBER, "1", "`iou_first` minus `iou_second`"),
)

PREDICTIONS = Table(
    "detect/<split>/seed<seed>/predictions/<trained>_on_<evaluated>.parquet",
    "A prediction",
    KEY_NAME,
    KIND,
    CONFIDENCE,
    BOX,
)
DETECTION = Table(
    "detect/detection.parquet",
    "A detector, evaluated domain and kind",
    SIDES,
    ANY_KIND,
    SPLIT,
    SEED,
    Columns("shares_views", BOOL, "", "Whether photos of a view are both in the training and the test set"),
    TRAINING,
    IMAGES,
    Columns("left_out", INTEGER, "count", "Corrupt images of training and test, which are excluded"),
    UNITS,
    UNIT,
    LABELS_COUNT,
    METRICS,
)
BREAKDOWN = Table(
    "detect/breakdown.parquet",
    "A detector, domain, kind and group of photos or labels",
    SPLIT,
    SEED,
    SIDES,
    Columns(
        "by",
        TEXT,
        "",
        "Grouping: `all`, `size` of the box of the label (COCO: small below 32 x 32 px, medium up to 96 x 96, large), "
        "`exposure` (ms), `azimuth`, `light` or `terrain`",
    ),
    Columns("group", TEXT, "", "Value of the grouping `by`"),
    ANY_KIND,
    IMAGES,
    UNITS,
    LABELS_COUNT,
    METRICS,
)
CURVES = Table(
    "detect/<split>/seed<seed>/curves.parquet",
    "A point of a precision-recall curve",
    SIDES,
    KIND,
    Columns("iou", NUMBER, "1", "IoU threshold, 0.5 or 0.75"),
    Columns("recall", NUMBER, "1", "0, 0.01 ... 1"),
    Columns("precision", NUMBER, "1", "Maximum precision at this or a higher recall"),
)
FALSE_POSITIVES = Table(
    "detect/false_positives.parquet",
    "A detector, domain and region",
    SPLIT,
    SEED,
    SIDES,
    Columns(
        "region",
        TEXT,
        "",
        "`rock-free terrain`: photos of terrains without rock labels; `rock-free tiles`: tiles without rock labels of "
        "the remaining photos, which are divided into 8 x 4 tiles",
    ),
    Columns("terrains", TEXT, "", "Terrains of the photos"),
    IMAGES,
    UNITS,
    Columns("photo_areas", NUMBER, "count", "Rock-free area in units of the area of a photo"),
    Columns(
        "false_positives",
        INTEGER,
        "count",
        "Predicted rocks with a confidence of at least `detect.comparison.iou_confidence` that intersect each "
        "rock label by less than a tenth of the smaller box",
    ),
    interval_columns("per_photo", "1", "`false_positives` divided by `photo_areas`"),
    interval_columns("area_share", "1", "Share of the rock-free area that false positives cover"),
)
IPD = Table(
    "detect/ipd.parquet",
    "A detector, pair of domains and kind",
    SPLIT,
    SEED,
    PAIR,
    KIND,
    PAIRS,
    UNITS,
    UNIT,
    UNDETECTED,
    UNPAIRED,
    MIN_CONFIDENCE,
    IPDS,
)
IPD_ROCKS = Table(
    "detect/rocks.parquet",
    "A detector, pair of domains, terrain and rock",
    SPLIT,
    SEED,
    PAIR,
    Columns("terrain", INTEGER, "", "Terrain"),
    ROCK,
    KIND,
    PERFORMANCES,
)
INSTANCES = Table(
    "detect/<split>/seed<seed>/instances.parquet",
    "A detector, domain and label",
    SIDES,
    KEY_NAME,
    KIND,
    ROCK,
    Columns("iou", NUMBER, "1", "Largest IoU with a prediction; 0 if undetected"),
    Columns("area_px", NUMBER, "px2", "Area of the box of the label"),
)
DIFFERENCES = Table(
    "detect/differences.parquet",
    "A comparison of two detectors or domains with the same bootstrap replicates",
    SPLIT,
    SEED,
    Columns("metric", TEXT, "", "`map50` or `ipd`"),
    KIND,
    Columns("against", TEXT, "", "Reference domain of the IPD; empty for mAP"),
    Columns("trained evaluated", TEXT, "", "Detector and domain of `value`"),
    Columns("other_trained other_evaluated", TEXT, "", "Detector and domain of `other_value`"),
    Columns("value other_value", NUMBER, "1", "Values of the metric"),
    interval_columns("difference", "1", "`value` minus `other_value`"),
    PAIRS,
    IMAGES,
    UNITS,
    UNIT,
)
BAD_DEPTH_MM, BAD_DEPTH_PERCENT = 20.0, 1.0  # minimum depth error of a bad pixel
STEREO = Table(
    "detect/stereo.parquet",
    "A stereo pair of a domain",
    Columns("domain", TEXT, "", "Domain of the images"),
    KEY_NAME,
    KEY[1],
    Columns("position light azimuth", TEXT, "", "Further parts of the key of the left image"),
    KEY[3],
    Columns("pixels", INTEGER, "px", "Pixels of meshes visible to both cameras, between `nearest_m` and `farthest_m`"),
    Columns("valid_share", NUMBER, "1", "Share of these pixels with a depth"),
    Columns(
        "median_abs_error_mm",
        NUMBER,
        "mm",
        "Median absolute error of depth along the axis of the rectified left camera",
    ),
    Columns(
        "bad_share bad_relative_share",
        NUMBER,
        "1",
        "Share of pixels without a depth, or with an error above `bad_mm` or `bad_percent`",
    ),
)
STEREO_INSTANCES = Table(
    "detect/stereo_instances.parquet",
    "A rock in a stereo pair",
    Columns("domain", TEXT, "", "Domain of the images"),
    KEY_NAME,
    ROCK,
    Columns("pixels", INTEGER, "px", "Pixels of the rock"),
    Columns("performance", NUMBER, "1", "Share of these pixels with a depth error below `bad_mm`"),
)
STEREO_IPD = Table(
    "detect/stereo_ipd.parquet",
    "A pair of domains",
    PAIR[1],
    PAIRS,
    UNITS,
    UNIT,
    IPDS,
)
PICTURES = Table(
    "detect/pictures/<domain>/pictures.csv",
    "An image of the domain",
    KEY_NAME,
    Columns("state", TEXT, "", "`used`, `missing` or `corrupt`"),
    Columns("camera", TEXT, "", "Identifier of the camera"),
    Columns("terrains", TEXT, "", "Terrains in the image"),
)
PARTS = Table(
    "detect/<split>/split.csv",
    "A photo",
    KEY_NAME,
    Columns("part", TEXT, "", "`train`, `val` or `test`"),
)

CHANGE_ENDS = (
    "_twin",
    "",
    "_change",
    "_change_low",
    "_change_high",
)  # of columns of the twin, changed twin, difference


def _change(metric: str, description: str) -> Columns:
    names = " ".join(f"{metric}{end}" for end in CHANGE_ENDS)
    return Columns(names, NUMBER, "1", f"{description}: of the twin (`_twin`), of the changed twin, and the difference")


CHANGES = (
    _change("ipd", "IPD to the photos over these pairs"),
    _change("ipd_abs", "IPD with absolute differences"),
    _change("map50", "mAP@0.5"),
    _change("false_positives", "False positives per rock-free area of a photo, rocks only"),
    _change("false_positive_area", "Share of the rock-free area that false positives cover"),
)
ABLATION = Table(
    "gap/ablation.parquet",
    "A component, detector and kind",
    SPLIT,
    SEED,
    Columns("component", TEXT, "", "Name of the replaced component"),
    Columns("replaced", TEXT, "", "Difference from the twin of the run"),
    Columns("model", TEXT, "", "Reflectance model of the twin"),
    TRAINED,
    KIND,
    DETECTOR,
    *TRAINING[2:],
    Columns("images", INTEGER, "count", "Test photos common to all twins of the ablation"),
    UNITS,
    UNIT,
    Columns("pairs", INTEGER, "count", "Labelled objects of photo, twin and changed twin"),
    Columns("iou_photo iou_twin iou", NUMBER, "1", "Mean IoU over these objects in photos, twin and changed twin"),
    Columns("map50_photo", NUMBER, "1", "mAP@0.5 on photos"),
    Columns("false_positives_photo false_positive_area_photo", NUMBER, "1", "False positives on photos, rocks only"),
    CHANGES,
)
TABLES = (
    PREDICTIONS, DETECTION, BREAKDOWN, CURVES, FALSE_POSITIVES, IPD, IPD_ROCKS, INSTANCES, DIFFERENCES, STEREO,
    STEREO_INSTANCES, STEREO_IPD, PICTURES, PARTS, ABLATION,
)  # fmt: skip
