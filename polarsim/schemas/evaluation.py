"""Tables of the evaluation of every stage."""

from polarsim.schemas.photos import BOX, CONFIDENCE, KEY, KIND
from polarsim.schemas.stages import SOUNDNESS
from polarsim.schemas.table import BOOL, INTEGER, NUMBER, TEXT, Columns, Table

TERRAIN = Columns("terrain", INTEGER, "", "Terrain")
LIKENESS = (
    Columns("log2_twin_over_photo", NUMBER, "stops", "Brightness of the twin over that of the photo, median of pixels"),
    Columns("log2_difference", NUMBER, "stops", "Median absolute difference of brightness"),
    Columns("ssim", NUMBER, "1", "Structural similarity of the tone-mapped images"),
)

EVALUATION = Table(
    "evaluation/*_TerrainTT.csv",
    "A metric of a terrain",
    Columns("stage", TEXT, "", "`cameras`, `rocks`, `consistency`, `labels`, `render` or `materials`"),
    TERRAIN,
    Columns("subject", TEXT, "", "Evaluated part: a position, a kind of label with the task, a class of rocks"),
    Columns("metric", TEXT, "", "Name of the metric, see below"),
    Columns("value", NUMBER, "`unit`", "Value; empty where it is undefined"),
    Columns(
        "unit",
        TEXT,
        "",
        "`mm`, `px`, `deg`, `m`, `stops` (factors of 2), `1` (a share or ratio), or the name of counted items",
    ),
    Columns("n", INTEGER, "count", "Sample size"),
    Columns(
        "against",
        TEXT,
        "",
        "Reference: `truth` (of the analog), `labels` (annotated), `photos` (pixels), `own` (reported by the stage)",
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
        "Origin: `scan`, `published`, or `fitted`. A fitted ground is a thin plate through the feet of "
        "published rocks with a slope of at most 35 degrees, without craters and mounds between rocks; rock heights "
        "are above the fitted ground",
    ),
    Columns("vertices faces", INTEGER, "count", "Vertices and faces"),
    SOUNDNESS,
    Columns("islands", INTEGER, "count", "Connected components"),
    Columns("edge_mm", NUMBER, "mm", "Median length of edges"),
    Columns(
        "contact_share",
        NUMBER,
        "1",
        "Share of 72 directions around a rock in which the mesh is below the ground or at most 2 mm above the ground",
    ),
    Columns("copy_vertex_share", NUMBER, "1", "Vertices of the decimated mesh over vertices of the mesh"),
    Columns("copy_watertight", NUMBER, "", "Whether the decimated mesh is watertight, 0 or 1"),
    Columns("copy_hausdorff_mm", NUMBER, "mm", "Hausdorff distance between mesh and decimated mesh"),
    Columns("true_rock", NUMBER, "", "Id of the matched true rock (analog)"),
    Columns("true_size_m", NUMBER, "m", "Size of the true rock"),
    Columns(
        "surface_median_mm surface_p90_mm",
        NUMBER,
        "mm",
        "Distance from the visible true surface to the mesh, median and 90th percentile",
    ),
    Columns(
        "f_score_5mm",
        NUMBER,
        "1",
        "Harmonic mean of the shares of the visible true and reconstructed surfaces within 5 mm of the other surface",
    ),
    Columns(
        "surface_iou",
        NUMBER,
        "1",
        "Visible area common to the true and the reconstructed rock over the area of the union; lower if ground is "
        "reconstructed as rock or rock as ground",
    ),
)
OFFSETS = Table(
    "evaluation/offsets_TerrainTT.parquet",
    "A point on the visible reconstructed surface (analog)",
    Columns("rock", INTEGER, "", "Rock id; -1 is the ground"),
    Columns("x y z", NUMBER, "m", "Position, frame of the ground truth"),
    Columns("offset_mm", NUMBER, "mm", "Signed distance from the true surface, negative inside"),
)
LABEL_PAIRS = Table(
    "evaluation/label_pairs_TerrainTT.parquet",
    "A true box, or an unmatched label; photos of seeds are excluded",
    KEY,
    Columns("task", TEXT, "", "Relation of the photo to the seeds, see `tables/evaluation`"),
    KIND,
    Columns("annotated", BOOL, "", "Whether the object is a shadow in a photo with annotated shadows"),
    Columns("hit", BOOL, "", "Whether true box and label are matched with an IoU of at least 0.5"),
    Columns("iou", NUMBER, "1", "IoU of the match"),
    Columns("iou_best", NUMBER, "1", "IoU of the true box in the matching with the largest summed IoU"),
    Columns("truth_px label_px", NUMBER, "px", "Square root of the area of true box and label; empty if missing"),
    Columns("rock", INTEGER, "", "Rock id of the label"),
    Columns("source", TEXT, "", "Origin of the label, see `labels/labels.parquet`"),
    CONFIDENCE,
    BOX,
    Columns("true_x0 true_y0 true_x1 true_y1", NUMBER, "px", "Edges of the true box"),
    Columns("against", TEXT, "", "`truth` or `labels`"),
)
TWIN_PAIRS = Table(
    "evaluation/twin_pairs_TerrainTT.parquet",
    "A photo and the twin",
    KEY,
    Columns("model", TEXT, "", "Reflectance model of the twin"),
    Columns("lit_px", INTEGER, "px", "Pixels that are lit and not clipped in both images"),
    LIKENESS,
)
TABLES = (EVALUATION, MESH_SCORES, OFFSETS, LABEL_PAIRS, TWIN_PAIRS)
