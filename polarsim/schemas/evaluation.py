"""Tables of the evaluation of every stage."""

from polarsim.schemas import photos, stages
from polarsim.schemas.table import Shared

IN_PLACE, HELD_OUT, NOT_FITTED = "in place", "held out", "not fitted"  # relations of a photo to the fits of a twin
SHARED = Shared(
    """
    terrain | terrain | | Terrain
    brightness: log2_twin_over_photo | float64 | stops | Brightness of the twin over that of the photo, median on lit
        sand
    brightness: log2_difference | float64 | stops | Median absolute difference of brightness on lit sand
    relation | str | | `in place` (the photo took part in the fit of materials or ground), `held out` (it did not), or
        `not fitted` (nothing was fitted to photos)
    """,
    stages.SHARED,
    photos.SHARED,
)
EVALUATION = SHARED.table("""
    evaluation/*_TerrainTT.csv: A metric of a terrain
    stage | str | | `cameras`, `rocks`, `consistency`, `labels`, `render` or `materials`
    = terrain
    subject | str | | Evaluated part: a position, a kind of label with the task, a class of rocks
    metric | str | | Name of the metric, see below
    value | float64 | `unit` | Value; empty where it is undefined
    unit | str | | `mm`, `px`, `deg`, `m`, `stops` (factors of 2), `1` (a share or ratio), or the name of counted
        items
    n | int64 | count | Sample size
    against | str | | Reference: `truth` (of the analog), `labels` (annotated), `photos` (pixels), `own` (reported by
        the stage)
""")
MESH_SCORES = SHARED.table("""
    evaluation/meshes_TerrainTT.csv: A mesh
    mesh | str | | Name of the file
    rock | int64 | | Rock id; -1 is the ground
    made_from | str | | Origin: `scan`, `published`, `fitted`, or `photos`. A fitted ground is a thin plate through the
        feet of published rocks with a slope of at most 35 degrees, without craters and mounds between rocks; rock
        heights are above the fitted ground
    vertices faces | int64 | count | Vertices and faces
    = soundness
    islands | int64 | count | Connected components
    edge_mm | float64 | mm | Median length of edges
    contact_share | float64 | 1 | Share of 72 directions around a rock in which the mesh is below the ground or at
        most 2 mm above the ground
    copy_vertex_share | float64 | 1 | Vertices of the decimated mesh over vertices of the mesh
    copy_watertight | float64 | | Whether the decimated mesh is watertight, 0 or 1
    copy_hausdorff_mm | float64 | mm | Hausdorff distance between mesh and decimated mesh
    true_rock | float64 | | Id of the matched true rock (analog)
    true_size_m | float64 | m | Size of the true rock
    surface_median_mm surface_p90_mm | float64 | mm | Distance from the visible true surface to the mesh, median and
        90th percentile
    f_score_5mm | float64 | 1 | Harmonic mean of the shares of the visible true and reconstructed surfaces within 5 mm
        of the other surface
    surface_iou | float64 | 1 | Visible area common to the true and the reconstructed rock over the area of the union;
        lower if ground is reconstructed as rock or rock as ground
""")
OFFSETS = SHARED.table("""
    evaluation/offsets_TerrainTT.parquet: A point on the visible reconstructed surface (analog)
    rock | int64 | | Rock id; -1 is the ground
    x y z | float64 | m | Position, frame of the ground truth
    offset_mm | float64 | mm | Signed distance from the true surface, negative inside
""")
TRUE_SIZES = SHARED.table("""
    evaluation/rock_sizes_TerrainTT.parquet: A measured rock with a matched true rock (analog)
    rock | int64 | | Id of the measured rock
    true_rock | float64 | | Id of the true rock
    true_a_m true_b_m true_c_m | float64 | m | Axes of the true mesh cut at the true ground
    true_height_m true_diameter_m | float64 | m | Height and diameter of this part
    true_volume_m3 | float64 | m3 | Volume of this part
    whole_a_m whole_b_m whole_c_m | float64 | m | Axes of the entire true rock, with the buried part
""")
LABEL_PAIRS = SHARED.table("""
    evaluation/label_pairs_TerrainTT.parquet: A true box, or an unmatched label; photos of seeds are excluded
    = key
    task | str | | Relation of the photo to the seeds, see `tables/evaluation`
    = kind
    annotated | bool | | Whether the object is a shadow in a photo with annotated shadows
    hit | bool | | Whether true box and label are matched with an IoU of at least 0.5
    iou | float64 | 1 | IoU of the match
    iou_best | float64 | 1 | IoU of the true box in the matching with the largest summed IoU
    truth_px label_px | float64 | px | Square root of the area of true box and label; empty if missing
    rock | int64 | | Rock id of the label
    source | str | | Origin of the label, see `labels/labels.parquet`
    = confidence box
    true_x0 true_y0 true_x1 true_y1 | float64 | px | Edges of the true box
    against | str | | `truth` or `labels`
""")
APPEARANCE_PAIRS = SHARED.table("""
    evaluation/appearance_TerrainTT.parquet: A photo and the twin
    = key
    model | str | | Reflectance model of the twin
    = relation
    psnr_db | float64 | dB | PSNR of the compared part at a quarter of the size, after the best increasing tone curve
    ssim correlation | float64 | 1 | Structural similarity and correlation of the same images
    stops | float64 | stops | Median absolute difference of brightness on lit sand, without the median difference
    lit_px | int64 | px | Pixels of the reduced images that show only lit sand in the twin (neither shadow, rock nor
        wall), and are neither dark nor clipped in photo and twin
    = brightness
    features | int64 | count | SIFT features of the photo
    matches | int64 | count | Matches of features of photo and twin
    agreement | float64 | 1 | Share of the matches at the same position, within 4 px of the photo
    agreement_by_chance | float64 | 1 | The same share of matches with exchanged positions
    control_terrain | terrain | | Terrain of the control, the twin of the same view and Sun of another terrain; -1 or
        empty: none
    control_psnr_db | float64 | dB | PSNR of the photo and the control
    control_ssim control_correlation | float64 | 1 | Structural similarity and correlation of the photo and the control
    better_than_control | float64 | | Whether the PSNR of the photo's own twin is higher, 0 or 1; empty without control
""")
