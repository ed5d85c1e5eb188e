"""Tables of photos and of labels."""

from polarsim.schemas.table import Shared

SHARED = Shared("""
    key_name: key | str | | Photo key, such as `01_A_off_180_L_0256`
    key_terrain: terrain | terrain | | Terrain, the first part of the key
    exposure_ms | int64 | ms | Exposure, the last part of the key
    key: = key_name key_terrain
    key: position light azimuth camera | str | | Further parts of the key; azimuth: name of the lamp, or `no`
    key: = exposure_ms
    kind | str | | `rock` or `shadow`
    rock | int64 | | Rock id; of a shadow: id of the rock that casts the shadow; -1 if unknown
    confidence | float64 | 1 | Confidence of the label or prediction, 0 to 1
    box: x0 y0 x1 y1 | float64 | px | Edges of the box: left, top, right, bottom
""")
(BOX,) = SHARED["box"]
PHOTOS = SHARED.table("""
    acquire/TerrainTT/photos.parquet: A photo
    = key
    width height | int64 | px | Size of the photo
    bits | int64 | | Bit depth of the file
    sha256 | str | | SHA-256 of the file
    path | str | | Path of the file, relative to the folder of this table or a parent folder
""")
LABELS = SHARED.table("""
    labels/labels.parquet: A label of a photo
    = key kind rock
    source | str | | Origin: `seed` (annotated in this exposure bracket), `fused` (annotated under other lamps or in
        the second camera), `translated` (moved to the second camera without a known pose), `projected` (from a mesh),
        `cast` (shadow of a mesh); of twins `rendered`
    = confidence box
""")
UNDONE = SHARED.table("""
    labels/undone/KEY.parquet: A label that would differ without the annotation of photo KEY
    = key_name kind rock
    change | str | | `gone`, `moved` or `new`
    moved_px | float64 | px | Maximum displacement of an edge; NaN for `gone` and `new` labels
""")
