"""Tables of the report, below `tables/`. The first columns of each table are `run`, `source` and `config`."""

from polarsim.schemas import covers, detect, evaluation, rover, stages
from polarsim.schemas.table import Shared, Table

SHARED = Shared(
    """
    origin: run | str | | Name of the run, `results/<run>/`
    origin: source | str | | Data source: `analog` (simulated sandbox), `release` (published labels and meshes),
        `polar` (NASA's photos and scans)
    origin: config | str | | Hash of the options that can change a result, without the name of the run, folders of
        data, downloads and unused sections
    seeds | str | | Selection of the seeds: camera, rover light, azimuths, exposure; `none` with `labels.seeds: none`
    map_metrics: map50 map50_95 | float64 | 1 | Average precision at IoU 0.5, and mean over IoU 0.5 to 0.95
    map_metrics: iou_mean | float64 | 1 | Mean over labelled rocks of the largest IoU with a prediction; 0 if
        undetected
    likeness_to_photo: psnr_db | float64 | dB | PSNR of photo and twin at a quarter of the size after the best
        increasing tone curve
    likeness_to_photo: ssim correlation | float64 | 1 | Structural similarity and correlation of the same images
    found_by | str | | Origin: `scan`, `published` or `override`
    boxes | str | | Boxes: `detector`, `truth` (labels instead of detections), or `visible` (labels with contrast in
        the image)
    """,
    evaluation.SHARED,
    detect.SHARED,
)
ORIGIN = SHARED["origin"]
DETECTION = SHARED.table("""
    tables/detection: A detector, evaluated domain and kind
    = sides any_kind split seed shares_views training images left_out labels_count
    = map_metrics unit units
    map50_low map50_high map50_95_low map50_95_high iou_mean_low iou_mean_high | float64 | 1 | 95 % intervals,
        bootstrapped over `units`; empty for a single unit
    paper_map50 paper_map50_95 paper_iou_mean | float64 | 1 | Values in the paper (rocks only)
""")
IPD = SHARED.table("""
    tables/ipd: A detector, pair of domains and kind
    = split seed pair kind pairs ipds units unit undetected unpaired min_confidence
    paper_ipd | float64 | 1 | Value in the paper (rocks only)
""")
STEREO = SHARED.table("""
    tables/stereo: A domain and terrain, and all terrains of a domain
    domain | str | | Domain of the images
    terrain | str | | Terrain, or `all`
    pairs | int64 | count | Stereo pairs
    = stereo
    rocks | int64 | count | Rocks in the pairs
    performance | float64 | 1 | Mean over rocks of the share of pixels with the correct depth
""")
CAMERAS = SHARED.table("""
    tables/cameras: A terrain and position
    = terrain position
    method | str | | Method of localisation: `scans`, `labels`, or unconfirmed `labels, unsure` or `survey`; followed
        by `, photos` after refinement on photos
    x_m y_m z_m | float64 | m | Position of the left camera, sandbox frame
    yaw_deg pitch_deg roll_deg | float64 | deg | Orientation: yaw from +X towards +Y, pitch downwards
    sd_mm | float64 | mm | Formal standard deviation of the position
    sd_deg | float64 | deg | Formal standard deviation of the orientation
    off_survey_m | float64 | m | Distance from the surveyed position
    off_survey_deg | float64 | deg | Angle to the surveyed orientation
    median_off_before_px median_off_px | float64 | px | Median offset between photos and shaded meshes before and
        after the refinement, along the best-determined direction of each window
    error_mm | float64 | mm | Distance from the true position after a rigid alignment (analog)
    error_deg | float64 | deg | Angle to the true orientation after the alignment (analog)
    reprojection_l_px reprojection_r_px | float64 | px | Median distance between projections of true points by the
        true and the estimated camera (analog)
    rock_reprojection_l_px rock_reprojection_r_px | float64 | px | Reprojection error of points of true rocks with the
        meshes aligned with the true surface (analog)
""")
ALIGNMENT = SHARED.table("""
    tables/alignment: A pair of scans, or the boxes of a position
    = terrain
    evidence | str | | `scans` or `labels`
    between | str | | Pair of positions, or position
    points | float64 | count | Samples of the first scan on the surface of the second scan
    fitness | float64 | 1 | Share of these samples
    rmse_mm | float64 | mm | RMS distance of these samples
    agreement | float64 | 1 | Share of common cells in which heights agree within 15 mm
    matched | float64 | count | Rocks matched with a box
    mean_iou | float64 | 1 | Mean IoU of the projected meshes and boxes of these rocks
    median_dx_px median_dy_px | float64 | px | Median distance between the centres of these boxes
""")
RENDER = SHARED.table("""
    tables/render: A subject, group and its value
    subject | str | | A model, with the relation of the photos to the fits if anything was fitted, or boxes of twins:
        `rendered rock`, `rendered shadow`
    group | str | | `all`, `terrain`, `position`, `azimuth`, `light` or `camera`
    value | str | | Value of the group
    n | int64 | count | Compared photos, at most 1 per exposure bracket; for boxes: true boxes
    = brightness
    f1 miou | float64 | 1 | F1 and mean IoU of boxes against true or annotated boxes, by terrain
""")
APPEARANCE = SHARED.table("""
    tables/appearance: A model, relation, group of photos and its value
    model | str | | Reflectance model of the twins
    = relation
    group | str | | `all`, `terrain`, `position`, `azimuth` or `light`
    value | str | | Value of the group
    photos | int64 | count | Compared photos, at most 1 per exposure bracket
    views | int64 | count | Views (terrain, position and camera) of these photos, the units of the bootstrap
    psnr_db | interval | dB | Median PSNR of photo and twin after the best increasing tone curve
    ssim | interval | 1 | Median structural similarity of the same images
    correlation | interval | 1 | Median correlation of the same images
    stops | interval | stops | Median over photos of the median absolute difference of brightness on lit sand, without
        the median difference; empty for published photos of 8 bits
    matches | int64 | count | Matches of SIFT features of photo and twin, all photos
    agreement | interval | 1 | Share of these matches at the same position, within 4 px
    agreement_by_chance | float64 | 1 | The same share of matches with exchanged positions
    controlled | int64 | count | Photos with a control, the twin of the same view and Sun of another terrain
    better_share | float64 | 1 | Share of these photos with a higher PSNR of the own twin
    psnr_gain_db | interval | dB | Median over photos of the PSNR of the own twin minus that of the control
    ssim_gain | interval | 1 | The same, structural similarity
    correlation_gain | interval | 1 | The same, correlation
    control | str | | `better` if the intervals of the three gains are above 0, else `refused`: the tone curve explains
        the twin of another terrain as well; empty without control or with less than 5 views
""")
APPEARANCE_DIFFERENCES = SHARED.table("""
    tables/appearance_differences: Two models, group of photos and its value
    first second | str | | Models, with the relation of the photos to the fits if anything was fitted
    group | str | | `all`, `terrain`, `position`, `azimuth` or `light`
    value | str | | Value of the group
    photos | int64 | count | Photos with twins of both models
    views | int64 | count | Views of these photos, the units of the bootstrap
    psnr_db | interval | dB | Mean over photos of the PSNR of the first model minus that of the second
    ssim | interval | 1 | The same, structural similarity
    correlation | interval | 1 | The same, correlation
    stops | interval | stops | The same, differences of brightness; empty for published photos of 8 bits
""")
ROCK_ABUNDANCE = SHARED.table("""
    tables/rock_abundance: A terrain, and all terrains
    terrain | str | | Terrain, or `all`
    rocks | int64 | count | Rocks with a diameter of at least 8 cm
    area_m2 | float64 | m2 | Area of the examined ground, under rocks included
    per_m2 | interval | 1 / m2 | Number of these rocks per area
    covered | float64 | 1 | Share of the ground that discs of these diameters cover
    k | interval | 1 | Share covered by rocks of all sizes by the law of Golombek and Rapp (1997), fitted to these rocks
""")
LABELS = SHARED.table("""
    tables/labels: A kind, task, group and value
    kind | str | | `rock`, `shadow`, or `shadow, where annotated`
    task | str | | Relation of the photo to the seeds, see `tables/evaluation`, labels
    group | str | | `all`, `terrain`, `position`, `azimuth`, or `size`: square root of the box area, px
    value | str | | Value of the group; a size class includes the lower bound
    truth_boxes label_boxes | int64 | count | Boxes of all photos, including copies in each exposure
    precision recall f1 miou | float64 | 1 | Metrics as in `tables/evaluation`
    confidence | float64 | 1 | Mean confidence of the labels; equal to the precision for calibrated labels
    = seeds
""")
RELIABILITY = SHARED.table("""
    tables/reliability: A kind, source of labels and bin of confidence
    = kind
    label_source | str | | Origin of the labels, or `all`
    labels | float64 | count | Distinct boxes; a box with copies of different confidence is divided among bins
    low high confidence | float64 | 1 | Minimum, maximum and mean confidence in the bin; at most 10 bins with about
        equal numbers of labels and at least 30 labels each
    right right_low right_high | float64 | 1 | Share of correct labels with 95 % interval (Wilson)
    brier | float64 | 1 | Brier score: mean squared error of the confidence
    = seeds
""")

# Tables with the columns of a table of a stage.
BREAKDOWN = Table("tables/detection_breakdown", "A detector, domain, kind and group", detect.BREAKDOWN.declared)
FALSE_POSITIVES = Table("tables/false_positives", "A detector, domain and region", detect.FALSE_POSITIVES.declared)
IPD_ROCKS = Table("tables/ipd_rocks", "A detector, pair of domains, terrain and rock", detect.IPD_ROCKS.declared)
DIFFERENCES = Table("tables/differences", "A comparison of two detectors or domains", detect.DIFFERENCES.declared)
GAP = Table("tables/gap", "A component, detector and kind", detect.ABLATION.declared)
COVERS = Table("tables/covers", "A terrain, kind and training", covers.COVER_SCORES.declared)
REAL_DETECTION = Table("tables/real_detection", "A detector, evaluated domain and kind", DETECTION.declared)
REAL_IPD = Table("tables/real_ipd", "A detector, pair of domains and kind", IPD.declared)
REAL_DIFFERENCES = Table(
    "tables/real_differences", "A comparison of two detectors or domains", detect.DIFFERENCES.declared
)
REAL_PHOTOS = Table(
    "tables/real_photos",
    "A detector, domain of twins, photo and kind",
    (*covers.PHOTO_IPD.declared, *SHARED["likeness_to_photo"]),
)
MASKS = Table("tables/masks", "A region, photo and class", covers.MASK_SCORES.declared)
EVALUATION = Table("tables/evaluation", "A metric and terrain", evaluation.EVALUATION.declared)
ROVER_DRIVES = Table("tables/rover", "A controller, metric and wheel", rover.DRIVES.declared)
ROVER_AUTONOMY = Table("tables/rover_autonomy", "A kind of drive and metric", rover.AUTONOMY.declared)
ROVER_EFFECTS = Table(
    "tables/rover_autonomy_effects", "A mode, axis, level and metric", rover.AUTONOMY_EFFECTS.declared
)
ROVER_RANK = Table("tables/rover_rank", "A mode, metric of the gap and metric of drives", rover.AUTONOMY_RANK.declared)
MESHES = Table("tables/meshes", "A mesh", (*SHARED["terrain"], *evaluation.MESH_SCORES.declared))
ROCKS = Table(
    "tables/rocks",
    "A rock",
    (*SHARED["terrain"], *stages.ROCKS.declared[:-2], *SHARED["found_by"], stages.ROCKS.declared[-1]),
)
ELSEWHERE = Table("tables/elsewhere", "A folder of images and size class", detect.ELSEWHERE.declared)
ROCK_DIAMETERS = Table("tables/rock_diameters", "A rock from detections alone", detect.ROCK_DIAMETERS.declared)
ROCK_SIZES = Table(
    "tables/rock_sizes",
    "A rock with a mesh",
    (*SHARED["terrain"], *stages.ROCK_SIZES.declared, *evaluation.TRUE_SIZES.declared[1:]),
)
ROVER_ONBOARD = Table(
    "tables/rover_onboard", "A metric of the front camera", (*SHARED["boxes"], *rover.ONBOARD.declared[1:])
)
