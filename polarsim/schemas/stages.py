"""Tables of the stages cameras and rocks."""

from polarsim.schemas.table import BOOL, INTEGER, NUMBER, TEXT, Columns, Table

ROCK_ID = Columns("rock", INTEGER, "", "Rock id")
POSITION = Columns("position", TEXT, "", "Position of the rig")
SOUNDNESS = Columns("watertight", BOOL, "", "Whether the mesh is watertight")

MATCHES = Table(
    "cameras/TerrainTT/matches.parquet",
    "A rock at a position, from labels",
    POSITION,
    ROCK_ID,
    Columns("seed_x0 seed_y0 seed_x1 seed_y1", NUMBER, "px", "Consensus of the seed boxes"),
    Columns("mesh_x0 mesh_y0 mesh_x1 mesh_y1", NUMBER, "px", "Box of the projected mesh"),
    Columns("iou", NUMBER, "1", "IoU of both boxes"),
    Columns("dx_px dy_px", NUMBER, "px", "Centre of the mesh box minus centre of the seed box"),
)
ALIGNMENT = Table(
    "cameras/TerrainTT/alignment.csv",
    "A pair of scans",
    Columns("pair", TEXT, "", "Positions of the scans, such as `A-C`"),
    Columns("fitness", NUMBER, "1", "Share of the samples of the first scan on the surface of the second scan"),
    Columns("rmse_mm", NUMBER, "mm", "RMS distance of these samples"),
    Columns("points", INTEGER, "count", "Number of these samples"),
    Columns("agreement", NUMBER, "1", "Share of common cells in which heights agree within 15 mm"),
)
TRANSLATIONS = Table(
    "cameras/TerrainTT/rock_translations.csv",
    "A published rock mesh, from labels",
    ROCK_ID,
    Columns("dx_mm dy_mm dz_mm", NUMBER, "mm", "Translation from the published position, sandbox frame"),
    Columns("sd_mm", NUMBER, "mm", "Standard deviation of the translation"),
    Columns("boxes", INTEGER, "count", "Views used for the fit of the translation"),
    Columns("iou_before iou_after", NUMBER, "1", "Mean IoU of the projected mesh with the boxes of these views"),
)
ROCKS = Table(
    "rocks/TerrainTT/rocks.parquet",
    "A rock",
    Columns(
        "rock",
        INTEGER,
        "",
        "Rock id; for rocks from scans: number of the 25 cm square of the sandbox with the rock centre, from 1, along "
        "x, then y (further rocks in a square: plus 256 and 512)",
    ),
    Columns("x y z", NUMBER, "m", "Centre, sandbox frame"),
    Columns("size_m", NUMBER, "m", "Longest side"),
    Columns("height_m", NUMBER, "m", "Height above the ground"),
    Columns("volume_m3", NUMBER, "m3", "Volume above the ground"),
    Columns("points", INTEGER, "count", "Points of the scans"),
    Columns("points_by_scan", TEXT, "", "Points by position, such as `A:8123 C:2210`"),
    Columns("visible_share", NUMBER, "1", "Share of the horizontal area of the rock covered by scans"),
    Columns(
        "scan_translation_mm",
        NUMBER,
        "mm",
        "Maximum translation that aligns a scan with the other scans at this rock; NaN for a single scan or an "
        "undetermined direction",
    ),
    Columns("x0 y0 z0 x1 y1 z1", NUMBER, "m", "Bounding cuboid of the rock in the scans"),
    Columns("source", TEXT, "", "Origin: `scan`, `published` or `override`"),
    Columns("confirmed", TEXT, "", "Positions with a seed box of the rock, such as `A C`; may be empty"),
)
MESHES = Table(
    "meshes/TerrainTT/meshes.csv",
    "A mesh",
    Columns("mesh", TEXT, "", "Name of the file"),
    Columns("vertices faces islands", INTEGER, "count", "Vertices, faces and connected components"),
    SOUNDNESS,
    Columns("volume_m3", NUMBER, "m3", "Volume; empty for open meshes"),
    Columns(
        "made_from", TEXT, "", "Origin: `scan`, `published`, or `fitted` (smooth ground fitted to published rocks)"
    ),
)
DEFECTS = Table(
    "repaired/TerrainTT/defects.csv",
    "A published rock mesh before the repair",
    ROCK_ID,
    Columns("vertices faces", INTEGER, "count", "Vertices and faces"),
    Columns("unused_vertices doubled_vertices", INTEGER, "count", "Vertices without a face, and copies of vertices"),
    Columns("islands", INTEGER, "count", "Connected components"),
    Columns("small_component_faces", INTEGER, "count", "Faces outside the largest component"),
    SOUNDNESS,
    Columns("holes", INTEGER, "count", "Holes without the rim"),
    Columns("rim_m", NUMBER, "m", "Length of the rim"),
    Columns("skirt_share", NUMBER, "1", "Share of the area less than 4 mm above the rim"),
)
TABLES = (MATCHES, ALIGNMENT, TRANSLATIONS, ROCKS, MESHES, DEFECTS)
