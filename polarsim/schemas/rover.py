"""Tables of the rover's drives."""

from polarsim.schemas.table import Shared

COLLISION, TOUCH, STOP = "collision", "touch", "stop"  # kinds of events
MODES = ("truth", "detector", "stereo", "both", "blind")  # inputs of the planner
POSES = KNOWN, ODOMETRY, FUSED = "truth", "odometry", "fused"  # sources of the rover's pose
ANY, ALL = "any", "all"  # level of an axis without effect on a drive, and all levels pooled
END_ERROR = "position error at the end, of the path"  # name of a metric
LOST_MOTIONS, REJECTED_MOTIONS = "stereo motions lost", "stereo motions rejected"  # names of metrics
HIGH_M = 0.10  # minimum height of a rock for a collision; contact with a lower rock is a touch
SHARED = Shared("""
    metric | str | | Name of the metric
    unit | str | | Unit of the metric
    seed | int64 | | Seed of the drive
    ended | str | | Reason for the end of the drive
    mode | str | | Input of the planner: labels (`truth`), `detector`, `stereo` depth, `both`, or none (`blind`:
        straight line)
    case: = mode
    case: sun exposure lights model detector | str | | Sun, exposure, rover lights, reflectance model and detector of
        the drive; `any`: without effect on the drive, `all`: pooled
    case: pose | str | | Pose by which the rover drives: `truth`, `odometry` (wheels and IMU), `fused` (with stereo
        odometry)
    drives_count: drives | int64 | count | Number of drives
    seeds_count: seeds | int64 | count | Number of seeds
    value | float64 | `unit` | Value of the metric
""")
DRIVE_METRICS = SHARED.table("""
    rover/drive_metrics.parquet: A drive and metric of the rover
    = seed
    control | str | | Controller of the drive
    = ended metric unit value
""")
DRIVES = SHARED.table("""
    rover/drives.parquet: A controller, metric and wheel
    control | str | | Controller of the drives
    = metric
    wheel | str | | Wheel; `all`: the rover
    = unit seeds_count
    mean | float64 | `unit` | Mean over drives
    low high | float64 | `unit` | 95 % interval of the mean (Student's t)
    least most | float64 | `unit` | Minimum and maximum over drives
""")
ONBOARD = SHARED.table("""
    rover/onboard.parquet: A metric of the front camera
    source | str | | Boxes: `detector`, `truth` (labels instead of detections), or `visible` (labels with contrast in
        the image); in `tables/rover_onboard` this column is `boxes`
    model | str | | Reflectance model of the images
    exposure_ms | float64 | ms | Exposure; 0: all exposures
    = metric
    height_m | float64 | m | Height of the rocks
    from_m to_m | float64 | m | Range of distances
    value low high | float64 | | Value with 95 % interval, bootstrapped over rides
    rides | int64 | count | Rides: drives under a given Sun
    count | float64 | count | Sample size
""")
AUTONOMY_EVENTS = SHARED.table("""
    rover/autonomy/<drive>/events.parquet: A stop, or all contacts of a part of the rover with a rock
    what | str | | `collision` (with a rock above 10 cm), `touch` (of a lower rock), `stop` (no path)
    time_s | float64 | s | Time from the start, of the first contact
    x_m y_m | float64 | m | Position of the rock, or of the rover at a stop
    rock | int64 | | Rock id
    height_m | float64 | m | Height of the rock
    part | str | | Part of the rover that touches the rock: `tread` or `flank` of a wheel, `leg`, `body`; empty for a
        stop
    duration_s | float64 | s | Time in contact
    impulse_n_s | float64 | N s | Absolute contact force over time
""")
AUTONOMY_ESTIMATE = SHARED.table("""
    rover/autonomy/<drive>/localisation/estimate.parquet: A logged time of a drive whose pose is not known
    time_s | float64 | s | Time from the start
    x_m y_m z_m | float64 | m | Estimated position of base_link in the world
    qw qx qy qz | float64 | | Estimated rotation, world from base_link
    x_sd_m y_sd_m z_sd_m | float64 | m | Standard deviation of the position
    rx_sd_rad ry_sd_rad rz_sd_rad | float64 | rad | Standard deviation of the rotation about the world's axes
""")
AUTONOMY_METRICS = SHARED.table("""
    rover/autonomy_metrics.parquet: A drive and metric
    = case seed ended metric unit value
""")
AUTONOMY = SHARED.table("""
    rover/autonomy.parquet: A kind of drive and metric
    = case metric unit drives_count seeds_count
    value low high | float64 | `unit` | Mean over drives with 95 % interval over seeds
""")
AUTONOMY_EFFECTS = SHARED.table("""
    rover/autonomy_effects.parquet: A mode (`all`: mean of all modes except `blind`), axis, level of the axis and metric
    = mode
    pose | str | | Pose by which the rovers drive; `all`: drives with several sources of poses
    axis | str | | `sun`, `exposure`, `lights`, `model`, `detector` or `pose`
    level | str | | Value on the axis
    = metric unit
    seeds | int64 | count | Seeds with all drives
    value low high | float64 | `unit` | Mean over the other axes with 95 % interval
    change change_low change_high | float64 | `unit` | Difference from the mean of the other levels of the axis with
        the same seeds, with 95 % interval
    rank rank_low rank_high | float64 | 1 | Rank of the level by the metric, 1 is best, with 95 % interval over seeds
""")
AUTONOMY_DETECTORS = SHARED.table("""
    rover/autonomy_detectors.parquet: A mode and detector
    = mode
    detector | str | | Name of the detector
    = drives_count seeds_count
    ipd | float64 | 1 | IPD of rocks between photos and the reflectance model of the rover images
    map50 | float64 | 1 | mAP@0.5 of rocks with this reflectance model
    rock_f1 | float64 | 1 | F1 of rock cells in the maps of the drives
    collisions | float64 | count | Mean number of collisions per drive
    success | float64 | 1 | Share of drives that arrive without a collision
    rock_points | float64 | count | Mean points of the rock map
""")
AUTONOMY_RANK = SHARED.table("""
    rover/autonomy_rank.parquet: A mode with detectors, metric of the gap and metric of drives
    = mode
    gap | str | | `ipd`, `map50` or `rock_f1`
    drive | str | | `collisions`, `success` or `rock_points`
    detectors drives | int64 | count | Detectors, and drives with the lights and seeds common to all
    units | int64 | count | Resampling units of intervals
    unit | str | | Resampling unit: `seed`, or `light` (Sun, exposure, lights) for a single seed
    spearman | interval | 1 | Spearman's rank correlation over detectors, positive if a smaller gap means better
        drives
    kendall | interval | 1 | Kendall's rank correlation
    kendall_p | float64 | 1 | Share of random orders with at least this absolute correlation
    says | str | | Verdict: `too few detectors` (fewer than 5), `nothing to order by` (all equal), `not shown`,
        `better` or `worse`
""")
