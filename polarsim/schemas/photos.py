"""Tables of photos and of labels."""

from polarsim.schemas.table import INTEGER, NUMBER, TEXT, Columns, Table

KEY_NAME = Columns("key", TEXT, "", "Photo key, such as `01_A_off_180_L_0256`")
KEY = (
    KEY_NAME,
    Columns("terrain", INTEGER, "", "Terrain, the first part of the key"),
    Columns("position light azimuth camera", TEXT, "", "Further parts of the key; azimuth in degrees, or `no`"),
    Columns("exposure_ms", INTEGER, "ms", "Exposure, the last part of the key"),
)
KIND = Columns("kind", TEXT, "", "`rock` or `shadow`")
ROCK = Columns("rock", INTEGER, "", "Rock id; of a shadow: id of the rock that casts the shadow; -1 if unknown")
CONFIDENCE = Columns("confidence", NUMBER, "1", "Confidence of the label or prediction, 0 to 1")
BOX = Columns("x0 y0 x1 y1", NUMBER, "px", "Edges of the box: left, top, right, bottom")

PHOTOS = Table(
    "acquire/TerrainTT/photos.parquet",
    "A photo",
    KEY,
    Columns("width height", INTEGER, "px", "Size of the photo"),
    Columns("bits", INTEGER, "", "Bit depth of the file"),
    Columns("sha256", TEXT, "", "SHA-256 of the file"),
    Columns("path", TEXT, "", "Path of the file, relative to the folder of this table or a parent folder"),
)
LABELS = Table(
    "labels/labels.parquet",
    "A label of a photo",
    KEY,
    KIND,
    ROCK,
    Columns(
        "source",
        TEXT,
        "",
        "Origin: `seed` (annotated in this exposure bracket), `fused` (annotated under other lamps or in the second "
        "camera), `translated` (moved to the second camera without a known pose), `projected` (from a mesh), `cast` "
        "(shadow of a mesh); of twins `rendered`",
    ),
    CONFIDENCE,
    BOX,
)
UNDONE = Table(
    "labels/undone/KEY.parquet",
    "A label that would differ without the annotation of photo KEY",
    KEY_NAME,
    KIND,
    ROCK,
    Columns("change", TEXT, "", "`gone`, `moved` or `new`"),
    Columns("moved_px", NUMBER, "px", "Maximum displacement of an edge; NaN for `gone` and `new` labels"),
)
TABLES = (PHOTOS, LABELS, UNDONE)
