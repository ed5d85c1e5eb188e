"""Tables of the evaluation of every stage."""

from polarsim.schemas.photos import BOX, CONFIDENCE, KEY, KIND
from polarsim.schemas.stages import SOUNDNESS
from polarsim.schemas.table import BOOL, INTEGER, NUMBER, TEXT, Columns, Table

TERRAIN = Columns("terrain", INTEGER, "", "Terrain")
LIKENESS = (
    Columns("log2_twin_over_photo", NUMBER, "stops", "Brightness of the twin over its photo, median over lit pixels"),
    Columns("log2_difference", NUMBER, "stops", "Median of the absolute differences of pixels"),
    Columns("ssim", NUMBER, "1", "Structural similarity of the tone-mapped pictures"),
)

EVALUATION = Table(
    "evaluation/*_TerrainTT.csv",
    "A metric of a terrain",
    Columns("stage", TEXT, "", "`cameras`, `rocks`, `consistency`, `labels`, `render` or `materials`"),
    TERRAIN,
    Columns("subject", TEXT, "", "A position, a kind of label and its task, a class of rocks"),
    Columns("metric", TEXT, "", "Name of the metric, see below"),
    Columns("value", NUMBER, "`unit`", "Value; empty where it is undefined"),
    Columns(
        "unit",
        TEXT,
        "",
        "`mm`, `px`, `deg`, `m`, `stops` (factors of two), `1` (a share or ratio), or what is counted",
    ),
    Columns("n", INTEGER, "count", "Number of objects that the metric was measured on"),
    Columns(
        "against",
        TEXT,
        "",
        "`truth` (of the analog), `labels` (hand-annotated), `photos` (pixels), `own` (the stage's own report)",
    ),
)
MESH_SCORES = Table(
    "evaluation/meshes_TerrainTT.csv",
    "A mesh",
    Columns("mesh", TEXT, "", "Name of the file"),
    Columns("rock", INTEGER, "", "Rock id; -1 is the ground"),
    Columns(
        "made_from",
        TEXT,
        "",
        "`scan`, `published`, or `fitted`: a thin plate on the feet of published rocks, at most 35 degrees steep, "
        "without the craters and mounds between rocks; heights of rocks count from it",
    ),
    Columns("vertices faces", INTEGER, "count", "Vertices and faces"),
    SOUNDNESS,
    Columns("islands", INTEGER, "count", "Connected parts"),
    Columns("edge_mm", NUMBER, "mm", "Median length of an edge"),
    Columns(
        "contact_share",
        NUMBER,
        "1",
        "Share of 72 directions about a rock in which its mesh is below the ground or at most 2 mm above it",
    ),
    Columns("copy_vertex_share", NUMBER, "1", "Vertices of the thinned copy over those of the mesh"),
    Columns("copy_watertight", NUMBER, "", "Whether the thinned copy is closed, 0 or 1"),
    Columns("copy_hausdorff_mm", NUMBER, "mm", "Largest distance between the mesh and its thinned copy"),
    Columns("true_rock", NUMBER, "", "Id of the true rock that is paired with it (analog)"),
    Columns("true_size_m", NUMBER, "m", "Size of the true rock"),
    Columns(
        "surface_median_mm surface_p90_mm",
        NUMBER,
        "mm",
        "Distance from the scanned true surface to the nearest surface of the mesh, median and 90th percentile",
    ),
    Columns(
        "f_score_5mm",
        NUMBER,
        "1",
        "Harmonic mean of the shares of the true and of our scanned surface within 5 mm of each other",
    ),
    Columns(
        "surface_iou",
        NUMBER,
        "1",
        "Scanned surface of both the true rock and ours over that of either, by area; ground that is taken for rock, "
        "or rock for ground, lowers it",
    ),
)
OFFSETS = Table(
    "evaluation/offsets_TerrainTT.parquet",
    "A point on our scanned surface (analog)",
    Columns("rock", INTEGER, "", "Rock id; -1 is the ground"),
    Columns("x y z", NUMBER, "m", "Position, true frame"),
    Columns("offset_mm", NUMBER, "mm", "Distance from the true surface, negative inside it"),
)
LABEL_PAIRS = Table(
    "evaluation/label_pairs_TerrainTT.parquet",
    "A true box, or a label without a partner; photos that are seeds are left out",
    KEY,
    Columns("task", TEXT, "", "Relation of the photo to the seeds, see `tables/evaluation`"),
    KIND,
    Columns("annotated", BOOL, "", "Whether it is a shadow of a photo in which people annotate shadows"),
    Columns("hit", BOOL, "", "Whether it is paired with an IoU of 0.5 or more"),
    Columns("iou", NUMBER, "1", "IoU of the pair"),
    Columns("iou_best", NUMBER, "1", "IoU of the true box in the pairing with the largest sum"),
    Columns("truth_px label_px", NUMBER, "px", "Square root of the area of true box and label; empty without one"),
    Columns("rock", INTEGER, "", "Rock id of the label"),
    Columns("source", TEXT, "", "Origin of the label, see `labels/labels.parquet`"),
    CONFIDENCE,
    BOX,
    Columns("true_x0 true_y0 true_x1 true_y1", NUMBER, "px", "Edges of the true box"),
    Columns("against", TEXT, "", "`truth` or `labels`"),
)
TWIN_PAIRS = Table(
    "evaluation/twin_pairs_TerrainTT.parquet",
    "A photo and its twin",
    KEY,
    Columns("model", TEXT, "", "Reflectance model of the twin"),
    Columns("lit_px", INTEGER, "px", "Pixels that are lit and not clipped in both"),
    LIKENESS,
)
TABLES = (EVALUATION, MESH_SCORES, OFFSETS, LABEL_PAIRS, TWIN_PAIRS)
