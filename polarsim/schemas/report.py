"""Tables of the report, below `tables/`; the columns `run`, `source` and `config` precede those of each table."""

from polarsim.schemas import covers, detect, evaluation, rover, stages
from polarsim.schemas.photos import KIND
from polarsim.schemas.table import INTEGER, NUMBER, TEXT, Columns, Table

ORIGIN = (
    Columns("run", TEXT, "", "Name of the run, `results/<run>/`"),
    Columns(
        "source",
        TEXT,
        "",
        "Source of its data: `analog` (generated sandbox), `release` (published labels and meshes), `polar` (NASA's "
        "photos and scans)",
    ),
    Columns(
        "config",
        TEXT,
        "",
        "Hash of the options that can change a result: not the name of the run, the folders of its data, its "
        "downloads, or sections that the run does not use",
    ),
)
SEEDS = Columns(
    "seeds",
    TEXT,
    "",
    "Annotated photos that the run started from: camera, rover light, azimuths, exposure; `none` with "
    "`labels.seeds: none`",
)


def _like(path: str, row: str, table: Table, *more: Columns) -> Table:
    """Declare a table of the report with the columns of a stage's table and further ones."""
    return Table(path, row, table.declared, *more)


def _part(table: Table, *names: str) -> tuple[Columns, ...]:
    return tuple(one for one in table.declared if set(one.each) & set(names))


MAP_METRICS = (
    Columns("map50 map50_95", NUMBER, "1", "Average precision at IoU 0.5, and its mean over IoU 0.5 to 0.95"),
    Columns("iou_mean", NUMBER, "1", "Mean over labelled rocks of the largest IoU with a prediction, 0 without one"),
)
DETECTION = Table(
    "tables/detection",
    "A detector, evaluated domain and kind",
    detect.SIDES,
    detect.ANY_KIND,
    detect.SPLIT,
    detect.SEED,
    _part(detect.DETECTION, "leaks_views"),
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
    Columns("paper_map50 paper_map50_95 paper_iou_mean", NUMBER, "1", "The paper's values (rocks only)"),
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
    Columns("paper_ipd", NUMBER, "1", "The paper's value (rocks only)"),
)
BREAKDOWN = _like("tables/detection_breakdown", "A detector, domain, kind and group", detect.BREAKDOWN)
FALSE_POSITIVES = _like("tables/false_positives", "A detector, domain and region", detect.FALSE_POSITIVES)
IPD_ROCKS = _like("tables/ipd_rocks", "A detector, pair of domains, terrain and rock", detect.IPD_ROCKS)
DIFFERENCES = _like("tables/differences", "A comparison of two detectors or domains", detect.DIFFERENCES)
GAP = _like("tables/gap", "A component, detector and kind", detect.ABLATION)
STEREO = Table(
    "tables/stereo",
    "A domain and terrain, and all terrains of a domain",
    Columns("domain", TEXT, "", "Domain of the pictures"),
    Columns("terrain", TEXT, "", "Terrain, or `all`"),
    Columns("pairs", INTEGER, "count", "Left and right pictures that were matched"),
    _part(detect.STEREO, "valid_share", "median_abs_error_mm", "bad_share"),
    Columns("rocks", INTEGER, "count", "Rocks in the pairs"),
    Columns("performance", NUMBER, "1", "Mean share of a rock's pixels with the right depth"),
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
        "`scans`, `labels` or, without a proof, `labels, unsure` or `survey`; with `, photos` where refined on photos",
    ),
    Columns("x_m y_m z_m", NUMBER, "m", "Left camera, sandbox frame"),
    Columns("yaw_deg pitch_deg roll_deg", NUMBER, "deg", "Its heading: yaw from +X towards +Y, pitch downwards"),
    Columns("sd_mm", NUMBER, "mm", "Formal standard deviation of the position"),
    Columns("sd_deg", NUMBER, "deg", "Formal standard deviation of the heading"),
    Columns("off_survey_m", NUMBER, "m", "Distance from the surveyed position"),
    Columns("off_survey_deg", NUMBER, "deg", "Angle to the surveyed heading"),
    Columns(
        "median_off_before_px median_off_px",
        NUMBER,
        "px",
        "Median distance of photos from the shaded meshes before and after the refinement, along each window's "
        "best-determined direction",
    ),
    Columns("error_mm", NUMBER, "mm", "Distance from the true position, after a rigid alignment (analog)"),
    Columns("error_deg", NUMBER, "deg", "Angle to the true heading after that alignment (analog)"),
    Columns(
        "reprojection_l_px reprojection_r_px",
        NUMBER,
        "px",
        "Median distance between true points projected by the true and by our camera (analog)",
    ),
    Columns(
        "rock_reprojection_l_px rock_reprojection_r_px",
        NUMBER,
        "px",
        "The same of true rocks' points with our meshes placed on the true surface",
    ),
)
ALIGNMENT = Table(
    "tables/alignment",
    "A pair of scans, or a position and its boxes",
    evaluation.TERRAIN,
    Columns("evidence", TEXT, "", "`scans` or `labels`"),
    Columns("between", TEXT, "", "Pair of positions, or position"),
    Columns("points", NUMBER, "count", "Samples of one scan that lie on the other"),
    Columns("fitness", NUMBER, "1", "Their share of all samples"),
    Columns("rmse_mm", NUMBER, "mm", "Their RMS distance"),
    Columns("agreement", NUMBER, "1", "Share of common cells whose heights agree to 15 mm"),
    Columns("matched", NUMBER, "count", "Rocks that are matched with a box"),
    Columns("mean_iou", NUMBER, "1", "Mean IoU of these rocks' projected meshes and boxes"),
    Columns("median_dx_px median_dy_px", NUMBER, "px", "Median distance of their centres"),
)
RENDER = Table(
    "tables/render",
    "A subject, group and its value",
    Columns("subject", TEXT, "", "A model, or `rendered rock`, `rendered shadow`: the twins' own boxes"),
    Columns("group", TEXT, "", "`all`, `terrain`, `position`, `azimuth`, `light` or `camera`"),
    Columns("value", TEXT, "", "Value of the group"),
    Columns("n", INTEGER, "count", "Compared photos, one an exposure bracket; of boxes: true ones"),
    evaluation.LIKENESS,
    Columns("f1 miou", NUMBER, "1", "Boxes against true or annotated ones, by terrain"),
)
ROCKS = Table(
    "tables/rocks",
    "A rock",
    evaluation.TERRAIN,
    stages.ROCKS.declared[:-2],
    Columns("found_by", TEXT, "", "`scan`, `published` or `override`"),
    stages.ROCKS.declared[-1],
)
MESHES = Table("tables/meshes", "A mesh", evaluation.TERRAIN, evaluation.MESH_SCORES.declared)
LABELS = Table(
    "tables/labels",
    "A kind, task, group and value",
    Columns("kind", TEXT, "", "`rock`, `shadow`, or `shadow, where annotated`"),
    Columns("task", TEXT, "", "Relation of the photo to the seeds, see `tables/evaluation`, labels"),
    Columns("group", TEXT, "", "`all`, `terrain`, `position`, `azimuth`, or `size`: square root of the box's area, px"),
    Columns("value", TEXT, "", "Value of the group; a size on an edge belongs to the class above"),
    Columns("truth_boxes label_boxes", INTEGER, "count", "Boxes of all photos: a copy on each exposure counts"),
    Columns("precision recall f1 miou", NUMBER, "1", "As in `tables/evaluation`, with the same counts"),
    Columns("confidence", NUMBER, "1", "Mean confidence of the labels; calibrated labels have that of their precision"),
    SEEDS,
)
RELIABILITY = Table(
    "tables/reliability",
    "A kind, source of labels and bin of confidence",
    KIND,
    Columns("label_source", TEXT, "", "Origin of the labels, or `all`"),
    Columns("labels", NUMBER, "count", "Distinct boxes; bins share a box whose copies differ in confidence"),
    Columns(
        "low high confidence",
        NUMBER,
        "1",
        "Minimum, maximum and mean confidence; bins hold about equal numbers of labels, at most ten bins with at least "
        "30 labels each",
    ),
    Columns("right right_low right_high", NUMBER, "1", "Share of right labels, and its 95 % interval (Wilson)"),
    Columns("brier", NUMBER, "1", "Mean squared distance of the confidence from 1 (right) or 0 (wrong)"),
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
