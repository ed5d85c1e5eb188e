"""Tables of the stage detect, and of the ablation of the gap."""

from polarsim.schemas.photos import BOX, CONFIDENCE, KEY, KEY_NAME, KIND, ROCK
from polarsim.schemas.table import BOOL, INTEGER, NUMBER, TEXT, Columns, Table, with_interval

TRAINED = Columns("trained", TEXT, "", "Domain of the detector's training")
SIDES = (TRAINED, Columns("evaluated", TEXT, "", "Domain of the test photos"))
PAIR = (TRAINED, Columns("first second", TEXT, "", "The domains that are compared"))
ANY_KIND = Columns("kind", TEXT, "", "`rock`, `shadow`, or `all`: mean of both")
SPLIT = Columns("split", TEXT, "", "How photos were split: by `photo` key, `view`, `position` or `terrain`")
SEED = Columns("seed", INTEGER, "", "Seed of the detector's training")
DETECTOR = Columns("detector", TEXT, "", "Model of the detector")
TRAINING = (
    DETECTOR,
    Columns("start", TEXT, "", "Weights that the training started from"),
    Columns("epochs", INTEGER, "count", "Epochs of the training"),
    Columns("imgsz", INTEGER, "px", "Longer side of the pictures in training and test"),
)
UNITS = Columns("units", INTEGER, "count", "Units that bootstrap intervals resample")
UNIT = Columns("unit", TEXT, "", "What a unit is: a `view` (terrain, position, camera) or a `photo`")
IMAGES = Columns("images", INTEGER, "count", "Test photos")
LABELS_COUNT = Columns("labels", INTEGER, "count", "Labels of the test photos")
PAIRS = Columns("pairs", INTEGER, "count", "Labelled objects in both domains: same photo key, same rock id")
METRICS = (
    with_interval("map50", "1", "Average precision at IoU 0.5"),
    with_interval("map50_95", "1", "Mean of the average precision over IoU 0.5 to 0.95"),
    with_interval("iou_mean", "1", "Mean over labelled rocks of the largest IoU with a prediction, 0 without one"),
)
IPDS = (
    Columns("ipd", NUMBER, "1", "Absolute value of the mean difference of IoU, the paper's formula"),
    Columns("ipd_abs", NUMBER, "1", "Mean of the absolute differences of IoU"),
    Columns("ipd_low ipd_high ipd_abs_low ipd_abs_high", NUMBER, "1", "95 % intervals; empty for a single unit"),
)
UNDETECTED = Columns(
    "undetected", TEXT, "", "Rule for a labelled rock that no prediction overlaps: `zero` (IoU 0) or `left_out`"
)
UNPAIRED = Columns("unpaired", TEXT, "", "Rule for a rock that is labelled in one domain only: `zero` or `left_out`")
MIN_CONFIDENCE = Columns("confidence", NUMBER, "1", "Minimum confidence of a prediction")
PERFORMANCES = (
    Columns("photos", INTEGER, "count", "Photos of the rock in both domains"),
    Columns("iou_first iou_second", NUMBER, "1", "Mean IoU over these photos in each domain"),
    Columns("difference", NUMBER, "1", "The first less the second"),
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
    Columns("leaks_views", BOOL, "", "Whether a view has photos both in training and in test"),
    TRAINING,
    IMAGES,
    Columns("left_out", INTEGER, "count", "Corrupt pictures of its training and of the test, which are left out"),
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
        "`all`, `size` of the label's box (COCO's classes: small below 32 x 32 px, medium up to 96 x 96, large), "
        "`exposure` (ms), `azimuth`, `light` or `terrain`",
    ),
    Columns("group", TEXT, "", "Value of `by`"),
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
    Columns("precision", NUMBER, "1", "Highest precision at this recall or a higher one"),
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
        "`rock-free terrain`: photos of terrains without a rock label; `rock-free tiles`: of 8 x 4 tiles of all other "
        "photos those that no rock label reaches into",
    ),
    Columns("terrains", TEXT, "", "Terrains of the photos"),
    IMAGES,
    UNITS,
    Columns("photo_areas", NUMBER, "count", "Rock-free area, in areas of a whole photo"),
    Columns(
        "false_positives",
        INTEGER,
        "count",
        "Predicted rocks of `detect.comparison.iou_confidence` or more that cover less than a tenth of the smaller "
        "one of themselves and each rock label",
    ),
    with_interval("per_photo", "1", "False positives over `photo_areas`"),
    with_interval("area_share", "1", "Share of the rock-free area that false positives cover"),
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
    Columns("iou", NUMBER, "1", "Largest IoU with a prediction, 0 without one"),
    Columns("area_px", NUMBER, "px2", "Area of the label's box"),
)
DIFFERENCES = Table(
    "detect/differences.parquet",
    "A comparison of two detectors or domains, both with the same resamples",
    SPLIT,
    SEED,
    Columns("metric", TEXT, "", "`map50` or `ipd`"),
    KIND,
    Columns("against", TEXT, "", "Domain that the IPD compares with; empty for mAP"),
    Columns("trained evaluated", TEXT, "", "Detector and domain of `value`"),
    Columns("other_trained other_evaluated", TEXT, "", "Detector and domain of `other_value`"),
    Columns("value other_value", NUMBER, "1", "The metric of both"),
    with_interval("difference", "1", "The first less the second"),
    PAIRS,
    IMAGES,
    UNITS,
    UNIT,
)
BAD_DEPTH_MM, BAD_DEPTH_PERCENT = 20.0, 1.0  # error of a stereo depth from which a pixel is bad
STEREO = Table(
    "detect/stereo.parquet",
    "A left and right picture of a domain",
    Columns("domain", TEXT, "", "Domain of the pictures"),
    KEY_NAME,
    KEY[1],
    Columns("position light azimuth", TEXT, "", "Further parts of the left picture's key"),
    KEY[3],
    Columns(
        "pixels", INTEGER, "px", "Pixels that both cameras show on the meshes, between `nearest_m` and `farthest_m`"
    ),
    Columns("valid_share", NUMBER, "1", "Share of these with a depth"),
    Columns("median_abs_error_mm", NUMBER, "mm", "Median error of the depth along the rectified left camera's axis"),
    Columns("bad_share bad_relative_share", NUMBER, "1", "Share without a depth, or off by `bad_mm` or `bad_percent`"),
)
STEREO_INSTANCES = Table(
    "detect/stereo_instances.parquet",
    "A rock in such a pair of pictures",
    Columns("domain", TEXT, "", "Domain of the pictures"),
    KEY_NAME,
    ROCK,
    Columns("pixels", INTEGER, "px", "Pixels of the rock"),
    Columns("performance", NUMBER, "1", "Share of them with a depth within `bad_mm`"),
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
    "A picture of the domain",
    KEY_NAME,
    Columns("state", TEXT, "", "`used`, `missing` or `corrupt`"),
    Columns("camera", TEXT, "", "Pictures of the same camera have the same value"),
    Columns("terrains", TEXT, "", "Terrains that the picture shows"),
)
PARTS = Table(
    "detect/<split>/split.csv",
    "A photo",
    KEY_NAME,
    Columns("part", TEXT, "", "`train`, `val` or `test`"),
)

CHANGE_METRICS = ("ipd", "ipd_abs", "map50", "false_positives", "false_positive_area")
CHANGE_ENDS = ("_twin", "", "_change", "_change_low", "_change_high")  # the twin, the changed twin, and what changes


def _change(metric: str, description: str) -> Columns:
    names = " ".join(f"{metric}{end}" for end in CHANGE_ENDS)
    return Columns(names, NUMBER, "1", f"{description}: of the twin (`_twin`), the changed twin, their difference")


CHANGES = (
    _change("ipd", "IPD to the photos over these pairs"),
    _change("ipd_abs", "The same with absolute differences"),
    _change("map50", "mAP@0.5"),
    _change("false_positives", "False positives per whole photo's rock-free area, rocks only"),
    _change("false_positive_area", "Share of the rock-free area that they cover"),
)
ABLATION = Table(
    "gap/ablation.parquet",
    "A component, detector and kind",
    SPLIT,
    SEED,
    Columns("component", TEXT, "", "Name of the component that is replaced"),
    Columns("replaced", TEXT, "", "What differs from the run's twin"),
    Columns("model", TEXT, "", "Reflectance model of the twin"),
    TRAINED,
    KIND,
    DETECTOR,
    *TRAINING[2:],
    Columns("images", INTEGER, "count", "Test photos that all twins of the ablation have"),
    UNITS,
    UNIT,
    Columns("pairs", INTEGER, "count", "Labelled objects of photo, twin and changed twin"),
    Columns("iou_photo iou_twin iou", NUMBER, "1", "Mean IoU over these in photos, twin and changed twin"),
    Columns("map50_photo", NUMBER, "1", "mAP@0.5 on photos"),
    Columns("false_positives_photo false_positive_area_photo", NUMBER, "1", "False positives on photos, rocks only"),
    CHANGES,
)
TABLES = (
    PREDICTIONS, DETECTION, BREAKDOWN, CURVES, FALSE_POSITIVES, IPD, IPD_ROCKS, INSTANCES, DIFFERENCES, STEREO,
    STEREO_INSTANCES, STEREO_IPD, PICTURES, PARTS, ABLATION,
)  # fmt: skip
