"""Tables of the report, below `tables/`. The first columns of each table are `run`, `source` and `config`."""

from polarsim.schemas import covers, detect, evaluation, rover, stages
from polarsim.schemas.photos import KIND
from polarsim.schemas.table import INTEGER, NUMBER, TEXT, Columns, Table

ORIGIN = (
    Columns("run", TEXT, "", "Name of the run, `results/<run>/`"),
    Columns(
        "source",
        TEXT,
        "",
        "Data source: `analog` (simulated sandbox), `release` (published labels and meshes), `polar` (NASA's photos "
        "and scans)",
    ),
    Columns(
        "config",
        TEXT,
        "",
        "Hash of the options that can change a result, without the name of the run, folders of data, downloads and "
        "unused sections",
    ),
)
SEEDS = Columns(
    "seeds",
    TEXT,
    "",
    "Selection of the seeds: camera, rover light, azimuths, exposure; `none` with `labels.seeds: none`",
)


def _like(path: str, row: str, table: Table, *more: Columns) -> Table:
    """Declare a table of the report with the columns of a table of a stage and further columns."""
    return Table(path, row, table.declared, *more)


def _part(table: Table, *names: str) -> tuple[Columns, ...]:
    return tuple(columns for columns in table.declared if set(columns.each) & set(names))


MAP_METRICS = (
    Columns("map50 map50_95", NUMBER, "1", "Average precision at IoU 0.5, and mean over IoU 0.5 to 0.95"),
    Columns("iou_mean", NUMBER, "1", "Mean over labelled rocks of the largest IoU with a prediction; 0 if undetected"),
)
DETECTION = Table(
    "tables/detection",
    "A detector, evaluated domain and kind",
    detect.SIDES,
    detect.ANY_KIND,
    detect.SPLIT,
    detect.SEED,
    _part(detect.DETECTION, "shares_views"),
    detect.TRAINING,
    detect.IMAGES,
    _part(detect.DETECTION, "left_out"),
    detect.LABELS_COUNT,
    MAP_METRICS,
    detect.UNIT,
    detect.UNITS,
    Columns(
        "map50_low map50_high map50_95_low map50_95_high iou_mean_low iou_mean_high",
        NUMBER,
        "1",
        "95 % intervals, bootstrapped over `units`; empty for a single unit",
    ),
    Columns("paper_map50 paper_map50_95 paper_iou_mean", NUMBER, "1", "Values in the paper (rocks only)"),
)
IPD = Table(
    "tables/ipd",
    "A detector, pair of domains and kind",
    detect.SPLIT,
    detect.SEED,
    detect.PAIR,
    KIND,
    detect.PAIRS,
    detect.IPDS,
    detect.UNITS,
    detect.UNIT,
    detect.UNDETECTED,
    detect.UNPAIRED,
    detect.MIN_CONFIDENCE,
    Columns("paper_ipd", NUMBER, "1", "Value in the paper (rocks only)"),
)
BREAKDOWN = _like("tables/detection_breakdown", "A detector, domain, kind and group", detect.BREAKDOWN)
FALSE_POSITIVES = _like("tables/false_positives", "A detector, domain and region", detect.FALSE_POSITIVES)
IPD_ROCKS = _like("tables/ipd_rocks", "A detector, pair of domains, terrain and rock", detect.IPD_ROCKS)
DIFFERENCES = _like("tables/differences", "A comparison of two detectors or domains", detect.DIFFERENCES)
GAP = _like("tables/gap", "A component, detector and kind", detect.ABLATION)
STEREO = Table(
    "tables/stereo",
    "A domain and terrain, and all terrains of a domain",
    Columns("domain", TEXT, "", "Domain of the images"),
    Columns("terrain", TEXT, "", "Terrain, or `all`"),
    Columns("pairs", INTEGER, "count", "Stereo pairs"),
    _part(detect.STEREO, "valid_share", "median_abs_error_mm", "bad_share"),
    Columns("rocks", INTEGER, "count", "Rocks in the pairs"),
    Columns("performance", NUMBER, "1", "Mean over rocks of the share of pixels with the correct depth"),
)
COVERS = _like("tables/covers", "A terrain, kind and training", covers.COVER_SCORES)
MASKS = _like("tables/masks", "A region, photo and class", covers.MASK_SCORES)
CAMERAS = Table(
    "tables/cameras",
    "A terrain and position",
    evaluation.TERRAIN,
    stages.POSITION,
    Columns(
        "method",
        TEXT,
        "",
        "Method of localisation: `scans`, `labels`, or unconfirmed `labels, unsure` or `survey`; followed by "
        "`, photos` after refinement on photos",
    ),
    Columns("x_m y_m z_m", NUMBER, "m", "Position of the left camera, sandbox frame"),
    Columns("yaw_deg pitch_deg roll_deg", NUMBER, "deg", "Orientation: yaw from +X towards +Y, pitch downwards"),
    Columns("sd_mm", NUMBER, "mm", "Formal standard deviation of the position"),
    Columns("sd_deg", NUMBER, "deg", "Formal standard deviation of the orientation"),
    Columns("off_survey_m", NUMBER, "m", "Distance from the surveyed position"),
    Columns("off_survey_deg", NUMBER, "deg", "Angle to the surveyed orientation"),
    Columns(
        "median_off_before_px median_off_px",
        NUMBER,
        "px",
        "Median offset between photos and shaded meshes before and after the refinement, along the best-determined "
        "direction of each window",
    ),
    Columns("error_mm", NUMBER, "mm", "Distance from the true position after a rigid alignment (analog)"),
    Columns("error_deg", NUMBER, "deg", "Angle to the true orientation after the alignment (analog)"),
    Columns(
        "reprojection_l_px reprojection_r_px",
        NUMBER,
        "px",
        "Median distance between projections of true points by the true and the estimated camera (analog)",
    ),
    Columns(
        "rock_reprojection_l_px rock_reprojection_r_px",
        NUMBER,
        "px",
        "Reprojection error of points of true rocks with the meshes aligned with the true surface (analog)",
    ),
)
ALIGNMENT = Table(
    "tables/alignment",
    "A pair of scans, or the boxes of a position",
    evaluation.TERRAIN,
    Columns("evidence", TEXT, "", "`scans` or `labels`"),
    Columns("between", TEXT, "", "Pair of positions, or position"),
    Columns("points", NUMBER, "count", "Samples of the first scan on the surface of the second scan"),
    Columns("fitness", NUMBER, "1", "Share of these samples"),
    Columns("rmse_mm", NUMBER, "mm", "RMS distance of these samples"),
    Columns("agreement", NUMBER, "1", "Share of common cells in which heights agree within 15 mm"),
    Columns("matched", NUMBER, "count", "Rocks matched with a box"),
    Columns("mean_iou", NUMBER, "1", "Mean IoU of the projected meshes and boxes of these rocks"),
    Columns("median_dx_px median_dy_px", NUMBER, "px", "Median distance between the centres of these boxes"),
)
RENDER = Table(
    "tables/render",
    "A subject, group and its value",
    Columns("subject", TEXT, "", "A model, or boxes of twins: `rendered rock`, `rendered shadow`"),
    Columns("group", TEXT, "", "`all`, `terrain`, `position`, `azimuth`, `light` or `camera`"),
    Columns("value", TEXT, "", "Value of the group"),
    Columns("n", INTEGER, "count", "Compared photos, at most 1 per exposure bracket; for boxes: true boxes"),
    evaluation.LIKENESS,
    Columns("f1 miou", NUMBER, "1", "F1 and mean IoU of boxes against true or annotated boxes, by terrain"),
)
ROCKS = Table(
    "tables/rocks",
    "A rock",
    evaluation.TERRAIN,
    stages.ROCKS.declared[:-2],
    Columns("found_by", TEXT, "", "Origin: `scan`, `published` or `override`"),
    stages.ROCKS.declared[-1],
)
MESHES = Table("tables/meshes", "A mesh", evaluation.TERRAIN, evaluation.MESH_SCORES.declared)
LABELS = Table(
    "tables/labels",
    "A kind, task, group and value",
    Columns("kind", TEXT, "", "`rock`, `shadow`, or `shadow, where annotated`"),
    Columns("task", TEXT, "", "Relation of the photo to the seeds, see `tables/evaluation`, labels"),
    Columns("group", TEXT, "", "`all`, `terrain`, `position`, `azimuth`, or `size`: square root of the box area, px"),
    Columns("value", TEXT, "", "Value of the group; a size class includes the lower bound"),
    Columns("truth_boxes label_boxes", INTEGER, "count", "Boxes of all photos, including copies in each exposure"),
    Columns("precision recall f1 miou", NUMBER, "1", "Metrics as in `tables/evaluation`"),
    Columns("confidence", NUMBER, "1", "Mean confidence of the labels; equal to the precision for calibrated labels"),
    SEEDS,
)
RELIABILITY = Table(
    "tables/reliability",
    "A kind, source of labels and bin of confidence",
    KIND,
    Columns("label_source", TEXT, "", "Origin of the labels, or `all`"),
    Columns(
        "labels", NUMBER, "count", "Distinct boxes; a box with copies of different confidence is divided among bins"
    ),
    Columns(
        "low high confidence",
        NUMBER,
        "1",
        "Minimum, maximum and mean confidence in the bin; at most 10 bins with about equal numbers of labels and at "
        "least 30 labels each",
    ),
    Columns("right right_low right_high", NUMBER, "1", "Share of correct labels with 95 % interval (Wilson)"),
    Columns("brier", NUMBER, "1", "Brier score: mean squared error of the confidence"),
    SEEDS,
)
EVALUATION = _like("tables/evaluation", "A metric and terrain", evaluation.EVALUATION)
ROVER_DRIVES = _like("tables/rover", "A controller, metric and wheel", rover.DRIVES)
ROVER_ONBOARD = Table(
    "tables/rover_onboard",
    "A metric of the front camera",
    Columns("boxes", TEXT, "", rover.ONBOARD.declared[0].description.partition(";")[0]),
    rover.ONBOARD.declared[1:],
)
ROVER_AUTONOMY = _like("tables/rover_autonomy", "A kind of drive and metric", rover.AUTONOMY)
ROVER_EFFECTS = _like("tables/rover_autonomy_effects", "A mode, axis, level and metric", rover.AUTONOMY_EFFECTS)
ROVER_RANK = _like("tables/rover_rank", "A mode, metric of the gap and metric of drives", rover.AUTONOMY_RANK)
TABLES = (
    DETECTION, BREAKDOWN, FALSE_POSITIVES, DIFFERENCES, IPD, IPD_ROCKS, STEREO, COVERS, MASKS, GAP, CAMERAS, ALIGNMENT,
    RENDER, ROCKS, MESHES, LABELS, RELIABILITY, EVALUATION, ROVER_DRIVES, ROVER_ONBOARD, ROVER_AUTONOMY, ROVER_EFFECTS,
    ROVER_RANK,
)  # fmt: skip
