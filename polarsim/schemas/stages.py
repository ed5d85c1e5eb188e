"""Tables of the stages cameras and rocks."""

from polarsim.schemas.table import Shared

SHARED = Shared("""
    rock_id: rock | int64 | | Rock id
    position | str | | Position of the rig
    soundness: watertight | bool | | Whether the mesh is watertight
""")
MATCHES = SHARED.table("""
    cameras/TerrainTT/matches.parquet: A rock at a position, from labels
    = position rock_id
    seed_x0 seed_y0 seed_x1 seed_y1 | float64 | px | Consensus of the seed boxes
    mesh_x0 mesh_y0 mesh_x1 mesh_y1 | float64 | px | Box of the projected mesh
    iou | float64 | 1 | IoU of both boxes
    dx_px dy_px | float64 | px | Centre of the mesh box minus centre of the seed box
""")
ALIGNMENT = SHARED.table("""
    cameras/TerrainTT/alignment.csv: A pair of scans
    pair | str | | Positions of the scans, such as `A-C`
    fitness | float64 | 1 | Share of the samples of the first scan on the surface of the second scan
    rmse_mm | float64 | mm | RMS distance of these samples
    points | int64 | count | Number of these samples
    agreement | float64 | 1 | Share of common cells in which heights agree within 15 mm
""")
TRANSLATIONS = SHARED.table("""
    cameras/TerrainTT/rock_translations.csv: A published rock mesh, from labels
    = rock_id
    dx_mm dy_mm dz_mm | float64 | mm | Translation from the published position, sandbox frame
    sd_mm | float64 | mm | Standard deviation of the translation
    boxes | int64 | count | Views used for the fit of the translation
    iou_before iou_after | float64 | 1 | Mean IoU of the projected mesh with the boxes of these views
""")
ROCKS = SHARED.table("""
    rocks/TerrainTT/rocks.parquet: A rock
    rock | int64 | | Rock id; for rocks from scans: number of the 25 cm square of the sandbox with the rock centre,
        from 1, along x, then y (further rocks in a square: plus 256 and 512)
    x y z | float64 | m | Centre, sandbox frame
    size_m | float64 | m | Longest side
    height_m | float64 | m | Height above the ground
    volume_m3 | float64 | m3 | Volume above the ground
    points | int64 | count | Points of the scans
    points_by_scan | str | | Points by position, such as `A:8123 C:2210`
    visible_share | float64 | 1 | Share of the horizontal area of the rock covered by scans
    scan_translation_mm | float64 | mm | Maximum translation that aligns a scan with the other scans at this rock; NaN
        for a single scan or an undetermined direction
    x0 y0 z0 x1 y1 z1 | float64 | m | Bounding cuboid of the rock in the scans
    source | str | | Origin: `scan`, `published` or `override`
    confirmed | str | | Positions with a seed box of the rock, such as `A C`; may be empty
""")
ROCK_SIZES = SHARED.table("""
    rocks/TerrainTT/sizes.parquet: A rock with a mesh; sizes are those of the exposed part, the part above the ground
    = rock_id
    a_m b_m c_m | float64 | m | Axes by calipers, a >= b >= c: c is the smallest distance between parallel planes around
        the rock, b the smallest distance perpendicular to c, a the dimension perpendicular to both
    a_azimuth_deg | float64 | deg | Azimuth of the a axis in the sandbox frame, from +X towards +Y, 0 to 180
    a_plunge_deg | float64 | deg | Angle between the a axis and the horizontal plane
    height_m | float64 | m | Height of the highest point above the ground, interpolated from the outline of the rock
    volume_m3 | float64 | m3 | Volume of the mesh above the ground
    length_m width_m | float64 | m | Longest dimension in plan, and dimension in plan perpendicular to it
    diameter_m | float64 | m | Mean of length and width, for size-frequency distributions
    made_from | str | | Origin of the mesh: `scan`, `published`, or `photos`
    a_error_m b_error_m c_error_m height_error_m diameter_error_m | float64 | m | Expected error of scanned rocks: the
        68th percentile of relative errors on the analog, for long axes from 8 cm and below; empty for other meshes
    volume_error_m3 | float64 | m3 | The same for the volume
""")
CLOUD_ROCKS = SHARED.table("""
    rocks_of_cloud.csv: A rock of a cloud; sizes are those of the visible part above the ground
    rock | int64 | | Number from 1, in the order of an oblique sweep
    x y z | float64 | unit of the file | Mean of the points, frame of the cloud
    a_m b_m c_m | float64 | m | Axes as in `rocks/TerrainTT/sizes.parquet`
    a_azimuth_deg | float64 | deg | Azimuth of the a axis, from the first towards the second axis in plan, 0 to 180
    a_plunge_deg | float64 | deg | Angle between the a axis and the ground
    height_m | float64 | m | Height of the highest point above the ground
    volume_m3 | float64 | m3 | Volume above the ground, by heights on a grid
    length_m width_m diameter_m | float64 | m | Longest dimension in plan, perpendicular dimension, and their mean
    points | int64 | count | Points
    visible_share | float64 | 1 | Share of the horizontal area of the rock that has points
""")
MESHES = SHARED.table("""
    meshes/TerrainTT/meshes.csv: A mesh
    mesh | str | | Name of the file
    vertices faces islands | int64 | count | Vertices, faces and connected components
    = soundness
    volume_m3 | float64 | m3 | Volume; empty for open meshes
    made_from | str | | Origin: `scan`, `published`, `fitted` (smooth ground fitted to published rocks), or `photos`
""")
DEFECTS = SHARED.table("""
    repaired/TerrainTT/defects.csv: A published rock mesh before the repair
    = rock_id
    vertices faces | int64 | count | Vertices and faces
    unused_vertices doubled_vertices | int64 | count | Vertices without a face, and copies of vertices
    islands | int64 | count | Connected components
    small_component_faces | int64 | count | Faces outside the largest component
    = soundness
    holes | int64 | count | Holes without the rim
    rim_m | float64 | m | Length of the rim
    skirt_share | float64 | 1 | Share of the area less than 4 mm above the rim
""")
