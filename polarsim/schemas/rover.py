"""Tables of the rover's drives."""

from polarsim.schemas.table import INTEGER, NUMBER, TEXT, Columns, Table, interval_columns

METRIC = Columns("metric", TEXT, "", "Name of the metric")
UNIT = Columns("unit", TEXT, "", "Unit of the metric")
SEED = Columns("seed", INTEGER, "", "Seed of the drive")
ENDED = Columns("ended", TEXT, "", "Reason for the end of the drive")
MODE = Columns(
    "mode",
    TEXT,
    "",
    "Input of the planner: labels (`truth`), `detector`, `stereo` depth, `both`, or none (`blind`: straight line)",
)
CASE = (
    MODE,
    Columns(
        "sun exposure lights model detector",
        TEXT,
        "",
        "Sun, exposure, rover lights, reflectance model and detector of the drive; `any`: without effect on the drive, "
        "`all`: pooled",
    ),
)
DRIVES_COUNT = Columns("drives", INTEGER, "count", "Number of drives")
SEEDS_COUNT = Columns("seeds", INTEGER, "count", "Number of seeds")
VALUE = Columns("value", NUMBER, "`unit`", "Value of the metric")

DRIVE_METRICS = Table(
    "rover/drive_metrics.parquet",
    "A drive and metric of the rover",
    SEED,
    Columns("control", TEXT, "", "Controller of the drive"),
    ENDED,
    METRIC,
    UNIT,
    VALUE,
)
DRIVES = Table(
    "rover/drives.parquet",
    "A controller, metric and wheel",
    Columns("control", TEXT, "", "Controller of the drives"),
    METRIC,
    Columns("wheel", TEXT, "", "Wheel; `all`: the rover"),
    UNIT,
    SEEDS_COUNT,
    Columns("mean", NUMBER, "`unit`", "Mean over drives"),
    Columns("low high", NUMBER, "`unit`", "95 % interval of the mean (Student's t)"),
    Columns("least most", NUMBER, "`unit`", "Minimum and maximum over drives"),
)
ONBOARD = Table(
    "rover/onboard.parquet",
    "A metric of the front camera",
    Columns(
        "source",
        TEXT,
        "",
        "Boxes: `detector`, `truth` (labels instead of detections), or `visible` (labels with contrast in the image); "
        "in `tables/rover_onboard` this column is `boxes`",
    ),
    Columns("model", TEXT, "", "Reflectance model of the images"),
    Columns("exposure_ms", NUMBER, "ms", "Exposure; 0: all exposures"),
    METRIC,
    Columns("height_m", NUMBER, "m", "Height of the rocks"),
    Columns("from_m to_m", NUMBER, "m", "Range of distances"),
    Columns("value low high", NUMBER, "", "Value with 95 % interval, bootstrapped over rides"),
    Columns("rides", INTEGER, "count", "Rides: drives under a given Sun"),
    Columns("count", NUMBER, "count", "Sample size"),
)
COLLISION, TOUCH, STOP = "collision", "touch", "stop"  # kinds of events
MODES = ("truth", "detector", "stereo", "both", "blind")  # inputs of the planner
ANY, ALL = "any", "all"  # level of an axis without effect on a drive, and all levels pooled
HIGH_M = 0.10  # minimum height of a rock for a collision; contact with a lower rock is a touch
AUTONOMY_EVENTS = Table(
    "rover/autonomy/<drive>/events.parquet",
    "An event of a drive",
    Columns("what", TEXT, "", "`collision` (with a rock above 10 cm), `touch` (of a lower rock), `stop` (no path)"),
    Columns("time_s", NUMBER, "s", "Time from the start"),
    Columns("x_m y_m", NUMBER, "m", "Position of the rover"),
    Columns("rock", INTEGER, "", "Rock id"),
    Columns("height_m", NUMBER, "m", "Height of the rock"),
)
AUTONOMY_METRICS = Table("rover/autonomy_metrics.parquet", "A drive and metric", CASE, SEED, ENDED, METRIC, UNIT, VALUE)
AUTONOMY = Table(
    "rover/autonomy.parquet",
    "A kind of drive and metric",
    CASE,
    METRIC,
    UNIT,
    DRIVES_COUNT,
    SEEDS_COUNT,
    Columns("value low high", NUMBER, "`unit`", "Mean over drives with 95 % interval over seeds"),
)
AUTONOMY_EFFECTS = Table(
    "rover/autonomy_effects.parquet",
    "A mode (`all`: mean of all modes except `blind`), axis, level of the axis and metric",
    MODE,
    Columns("axis", TEXT, "", "`sun`, `exposure`, `lights`, `model` or `detector`"),
    Columns("level", TEXT, "", "Value on the axis"),
    METRIC,
    UNIT,
    Columns("seeds", INTEGER, "count", "Seeds with all drives"),
    Columns("value low high", NUMBER, "`unit`", "Mean over the other axes with 95 % interval"),
    Columns(
        "change change_low change_high",
        NUMBER,
        "`unit`",
        "Difference from the mean of the other levels of the axis with the same seeds, with 95 % interval",
    ),
)
AUTONOMY_DETECTORS = Table(
    "rover/autonomy_detectors.parquet",
    "A mode and detector",
    MODE,
    Columns("detector", TEXT, "", "Name of the detector"),
    DRIVES_COUNT,
    SEEDS_COUNT,
    Columns("ipd", NUMBER, "1", "IPD of rocks between photos and the reflectance model of the rover images"),
    Columns("map50", NUMBER, "1", "mAP@0.5 of rocks with this reflectance model"),
    Columns("rock_f1", NUMBER, "1", "F1 of rock cells in the maps of the drives"),
    Columns("collisions", NUMBER, "count", "Mean number of collisions per drive"),
    Columns("success", NUMBER, "1", "Share of drives that arrive without a collision"),
    Columns("rock_points", NUMBER, "count", "Mean points of the rock map"),
)
AUTONOMY_RANK = Table(
    "rover/autonomy_rank.parquet",
    "A mode with detectors, metric of the gap and metric of drives",
    MODE,
    Columns("gap", TEXT, "", "`ipd`, `map50` or `rock_f1`"),
    Columns("drive", TEXT, "", "`collisions`, `success` or `rock_points`"),
    Columns("detectors drives", INTEGER, "count", "Detectors, and drives with the lights and seeds common to all"),
    Columns("units", INTEGER, "count", "Resampling units of intervals"),
    Columns("unit", TEXT, "", "Resampling unit: `seed`, or `light` (Sun, exposure, lights) for a single seed"),
    interval_columns(
        "spearman", "1", "Spearman's rank correlation over detectors, positive if a smaller gap means better drives"
    ),
    interval_columns("kendall", "1", "Kendall's rank correlation"),
    Columns("kendall_p", NUMBER, "1", "Share of random orders with at least this absolute correlation"),
    Columns(
        "says",
        TEXT,
        "",
        "Verdict: `too few detectors` (fewer than 5), `nothing to order by` (all equal), `not shown`, `better` or "
        "`worse`",
    ),
)
TABLES = (
    DRIVE_METRICS, DRIVES, ONBOARD, AUTONOMY_EVENTS, AUTONOMY_METRICS, AUTONOMY, AUTONOMY_EFFECTS, AUTONOMY_DETECTORS,
    AUTONOMY_RANK,
)  # fmt: skip
