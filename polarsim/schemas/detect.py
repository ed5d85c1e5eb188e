"""Tables of the stage detect, and of the ablation of the gap."""

from polarsim.schemas import photos
from polarsim.schemas.table import Shared

BAD_DEPTH_MM, BAD_DEPTH_PERCENT = 20.0, 1.0  # minimum depth error of a bad pixel
CHANGE_ENDS = ("_twin", "", "_change", "_change_low", "_change_high")  # of the twin, changed twin, difference
CHANGES = {
    "ipd": "IPD to the photos over these pairs",
    "ipd_abs": "IPD with absolute differences",
    "map50": "mAP@0.5",
    "false_positives": "False positives per rock-free area of a photo, rocks only",
    "false_positive_area": "Share of the rock-free area that false positives cover",
}
_CHANGES = Shared(
    "\n".join(
        f"changes: {' '.join(name + end for end in CHANGE_ENDS)} | float64 | 1 | {text}: of the twin (`_twin`), of the "
        "changed twin, and the difference"
        for name, text in CHANGES.items()
    )
)
SHARED = Shared(
    """
    trained | str | | Training domain of the detector
    sides: = trained
    sides: evaluated | str | | Domain of the test photos
    compared: first second | str | | Compared domains
    pair: = trained compared
    any_kind: kind | str | | `rock`, `shadow`, or `all`: mean of both
    split | str | | Unit of the split of photos: `photo` key, `view`, `position` or `terrain`
    seed | int64 | | Seed of the training
    detector | str | | Model of the detector
    start | str | | Initial weights of the training
    length: epochs | int64 | count | Epochs of the training
    length: imgsz | int64 | px | Longer side of the images in training and test
    training: = detector start length
    units | int64 | count | Resampling units of the bootstrap
    unit | str | | Resampling unit: `view` (terrain, position, camera) or `photo`
    images | int64 | count | Test photos
    labels_count: labels | int64 | count | Labels of the test photos
    pairs | int64 | count | Objects labelled in both domains: same photo key, same rock id
    metrics: map50 | interval | 1 | Average precision at IoU 0.5
    metrics: map50_95 | interval | 1 | Mean of the average precision over IoU 0.5 to 0.95
    metrics: iou_mean | interval | 1 | Mean over labelled rocks of the largest IoU with a prediction; 0 if undetected
    ipds: ipd | float64 | 1 | Absolute value of the mean difference of IoU, the formula of the paper
    ipds: ipd_abs | float64 | 1 | Mean of the absolute differences of IoU
    ipds: ipd_low ipd_high ipd_abs_low ipd_abs_high | float64 | 1 | 95 % intervals; empty for a single unit
    undetected | str | | Treatment of labelled rocks that no prediction overlaps: `zero` (IoU 0) or `left_out`
    unpaired | str | | Treatment of rocks labelled in a single domain: `zero` or `left_out`
    min_confidence: confidence | float64 | 1 | Minimum confidence of a prediction
    shares_views | bool | | Whether photos of a view are both in the training and the test set
    left_out | int64 | count | Corrupt images of training and test, which are excluded
    performances: photos | int64 | count | Photos of the rock in both domains
    performances: iou_first iou_second | float64 | 1 | Mean IoU over these photos in each domain
    performances: difference | float64 | 1 | `iou_first` minus `iou_second`
    stereo: valid_share | float64 | 1 | Share of these pixels with a depth
    stereo: median_abs_error_mm | float64 | mm | Median absolute error of depth along the axis of the rectified left
        camera
    stereo: bad_share bad_relative_share | float64 | 1 | Share of pixels without a depth, or with an error above
        `bad_mm` or `bad_percent`
    """,
    _CHANGES,
    photos.SHARED,
)
ELSEWHERE = SHARED.table("""
    detect/elsewhere/NAME.parquet: A size class of the rocks in images from outside POLAR
    name | str | | Name in `detect.elsewhere`
    size | str | | Longer side of the label over the image width: `small` (below 0.025), `medium`, `large` (from 0.1),
        or `all`
    images labels | int64 | count | Images, and labels of the size class
    recall | float64 | 1 | Recall of these labels at a confidence of 0.25 and an IoU of 0.5
    recall_at_half | float64 | 1 | The same at the confidence with at most 0.5 false positives per image
    map50 | interval | 1 | AP@0.5 of rocks, bootstrapped over images; size `all` only
    false_per_image | float64 | 1 | False positives per image at a confidence of 0.25; size `all` only
    calibration_error | float64 | 1 | Expected calibration error of rocks; size `all` only
    not_calibrated | float64 | 1 | Share of images whose confidences `polarsim detect` marks as not calibrated
""")
ROCK_DIAMETERS = SHARED.table("""
    detect/rock_diameters.parquet: A rock from detections alone
    terrain | int64 | | Terrain
    rock | int64 | | Number from 1 in the terrain, in the order of confidence
    x y | float64 | m | Centre in plan, sandbox frame, on level ground; median over boxes
    diameter_m | float64 | m | Horizontal width perpendicular to the line of sight, on level ground; median over boxes
    confidence | float64 | 1 | Maximum confidence of the boxes
    photos | int64 | count | Photos with a box of the rock
""")
PREDICTIONS = SHARED.table("""
    detect/<split>/seed<seed>/predictions/<trained>_on_<evaluated>.parquet: A prediction
    = key_name kind confidence box
""")
DETECTION = SHARED.table("""
    detect/detection.parquet: A detector, evaluated domain and kind
    = sides any_kind split seed shares_views training images left_out units unit labels_count metrics
""")
BREAKDOWN = SHARED.table("""
    detect/breakdown.parquet: A detector, domain, kind and group of photos or labels
    = split seed sides
    by | str | | Grouping: `all`, `size` of the box of the label (COCO: small below 32 x 32 px, medium up to 96 x 96,
        large), `exposure` (ms), `azimuth`, `light` or `terrain`
    group | str | | Value of the grouping `by`
    = any_kind images units labels_count metrics
""")
CURVES = SHARED.table("""
    detect/<split>/seed<seed>/curves.parquet: A point of a precision-recall curve
    = sides kind
    iou | float64 | 1 | IoU threshold, 0.5 or 0.75
    recall | float64 | 1 | 0, 0.01 ... 1
    precision | float64 | 1 | Maximum precision at this or a higher recall
""")
FALSE_POSITIVES = SHARED.table("""
    detect/false_positives.parquet: A detector, domain and region
    = split seed sides
    region | str | | `rock-free terrain`: photos of terrains without rock labels; `rock-free tiles`: tiles without
        rock labels of the remaining photos, which are divided into 8 x 4 tiles
    terrains | str | | Terrains of the photos
    = images units
    photo_areas | float64 | count | Rock-free area in units of the area of a photo
    false_positives | int64 | count | Predicted rocks with a confidence of at least `detect.comparison.iou_confidence`
        that intersect each rock label by less than a tenth of the smaller box
    per_photo | interval | 1 | `false_positives` divided by `photo_areas`
    area_share | interval | 1 | Share of the rock-free area that false positives cover
""")
IPD = SHARED.table("""
    detect/ipd.parquet: A detector, pair of domains and kind
    = split seed pair kind pairs units unit undetected unpaired min_confidence ipds
""")
IPD_ROCKS = SHARED.table("""
    detect/rocks.parquet: A detector, pair of domains, terrain and rock
    = split seed pair
    terrain | terrain | | Terrain
    = rock kind performances
""")
INSTANCES = SHARED.table("""
    detect/<split>/seed<seed>/instances.parquet: A detector, domain and label
    = sides key_name kind rock
    iou | float64 | 1 | Largest IoU with a prediction; 0 if undetected
    area_px | float64 | px2 | Area of the box of the label
""")
DIFFERENCES = SHARED.table("""
    detect/differences.parquet: A comparison of two detectors or domains with the same bootstrap replicates
    = split seed
    metric | str | | `map50` or `ipd`
    = kind
    against | str | | Reference domain of the IPD; empty for mAP
    trained evaluated | str | | Detector and domain of `value`
    other_trained other_evaluated | str | | Detector and domain of `other_value`
    value other_value | float64 | 1 | Values of the metric
    difference | interval | 1 | `value` minus `other_value`
    = pairs images units unit
""")
STEREO = SHARED.table("""
    detect/stereo.parquet: A stereo pair of a domain
    domain | str | | Domain of the images
    = key_name key_terrain
    position light azimuth | str | | Further parts of the key of the left image
    = exposure_ms
    pixels | int64 | px | Pixels of meshes visible to both cameras, between `nearest_m` and `farthest_m`
    = stereo
""")
STEREO_INSTANCES = SHARED.table("""
    detect/stereo_instances.parquet: A rock in a stereo pair
    domain | str | | Domain of the images
    = key_name rock
    pixels | int64 | px | Pixels of the rock
    performance | float64 | 1 | Share of these pixels with a depth error below `bad_mm`
""")
STEREO_IPD = SHARED.table("""
    detect/stereo_ipd.parquet: A pair of domains
    = compared pairs units unit ipds
""")
PICTURES = SHARED.table("""
    detect/pictures/<domain>/pictures.csv: An image of the domain
    = key_name
    state | str | | `used`, `missing` or `corrupt`
    camera | str | | Identifier of the camera
    terrains | str | | Terrains in the image
""")
PARTS = SHARED.table("""
    detect/<split>/split.csv: A photo
    = key_name
    part | str | | `train`, `val` or `test`
""")
ABLATION = SHARED.table("""
    gap/ablation.parquet: A component, detector and kind
    = split seed
    component | str | | Name of the replaced component
    replaced | str | | Difference from the twin of the run
    model | str | | Reflectance model of the twin
    = trained kind detector length
    images | int64 | count | Test photos common to all twins of the ablation
    = units unit
    pairs | int64 | count | Labelled objects of photo, twin and changed twin
    iou_photo iou_twin iou | float64 | 1 | Mean IoU over these objects in photos, twin and changed twin
    map50_photo | float64 | 1 | mAP@0.5 on photos
    false_positives_photo false_positive_area_photo | float64 | 1 | False positives on photos, rocks only
    = changes
""")
