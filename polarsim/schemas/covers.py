"""Tables of detectors evaluated on real photos of held-out terrains."""

from polarsim.schemas.detect import SHARED

# Detectors of a row of cover scores: of a single seed, mean over all seeds, all seeds merged (the latter have no seed).
SINGLE, MEAN, MERGED = "one", "mean", "merged"
# Training data of the detectors: rendered scenes only, or followed by labelled photos of other terrains.
RENDERED, FINE_TUNED = "rendered", "fine_tuned"
NO_SEED = -1
CONTROL = "control"  # domain of twins with invented relief; no detector is trained on it
COVER_FOUND = SHARED.table("""
    covers/folds/FOLD/seedN/TRAINED/found.parquet: A prediction on a cover photo of the fold
    key | str | | Key of the cover photo
    width | int64 | px | Inference width
    = kind confidence box
""")
COVER_SCORES = SHARED.table("""
    covers/TRAINED/scores.parquet: A terrain, kind and training
    trained | str | | Training data: `rendered` scenes only, or `fine_tuned` afterwards on labelled photos of other
        terrains
    terrain | str | | Terrain of the cover photos; `all`: all photos pooled
    = kind
    detectors | str | | Evaluated detectors: `one` of the given seed; `mean` over all seeds, with the same bootstrap
        replicates of photos for each seed; `merged`: ensemble of all seeds of a fold
    seed | int64 | | Seed of the training; -1 for `mean` and `merged`
    = detector
    start | str | | Initial weights of the training
    epochs | int64 | count | Epochs of the training
    folds | int64 | count | Detectors per seed
    pictures | int64 | count | Mean number of training images per detector
    images labels | int64 | count | Cover photos and their labels
    map50 | interval | 1 | Average precision at IoU 0.5
    map50_95 | float64 | 1 | Mean of the average precision over IoU 0.5 to 0.95
    iou_mean | float64 | 1 | Mean over labels of the largest IoU with a prediction
    calibration_error | float64 | 1 | Expected calibration error of boxes with a confidence of at least 0.05: mean
        difference of the confidence and the share of correct boxes (IoU 0.5), with each fold calibrated on the other
        folds; empty for a single fold
""")
MASK_SCORES = SHARED.table("""
    covers/mask_scores.parquet: A region, cover photo and class
    key | str | | Key of the photo; `all`: pixels of all photos pooled
    region | str | | `sand`: without annotated background; `photo`: with background as ground
    kind | str | | `ground`, `rock` or `shadow`
    photos | int64 | count | Photos
    pixels | int64 | px | Annotated pixels of the class
    iou | interval | 1 | IoU of masks and polygons; empty if both lack the class
""")
PHOTO_IPD = SHARED.table("""
    covers/domains/photos.parquet: A detector, domain of twins, photo and kind
    = split seed trained
    twin | str | | Domain of the twins
    = key_name kind pairs
    iou_photo iou_twin | float64 | 1 | Mean IoU over these pairs in the photo and in the twin
    difference | float64 | 1 | `iou_photo` minus `iou_twin`; positive if the twin is harder
    ipd_abs | float64 | 1 | Mean of the absolute differences of IoU
    label_iou | float64 | 1 | Mean IoU of the human boxes with rendered boxes: the performance in the photo of a
        detector that predicts the rendered boxes
""")
