"""Options of the cameras stage."""

from __future__ import annotations

from pydantic import BaseModel, Field


class CamerasOptions(BaseModel, extra="forbid", frozen=True):
    """How rigs are placed, from labels and meshes or from scans. The defaults fit the real data."""

    # Seed boxes of a set-up become one box a rock.
    consensus_share: float = Field(0.3, gt=0, le=1, description="Part of the azimuths that must show a box.")
    cluster_iou: float = Field(0.5, gt=0, lt=1, description="Boxes of two azimuths above this IoU are one rock's.")

    # Outlines of meshes: scanned rocks carry skirts of sand that people do not draw.
    trim_mm: float = Field(4, ge=0, description="Left and right edges come from vertices this far above the rim, mm.")
    trim_share: float = Field(0.35, ge=0, lt=1, description="... but never from above this part of the rock's height.")

    # What the survey is worth: decimetres and degrees.
    survey_sd_m: float = Field(0.4, gt=0, description="Prior on a tripod's place about the survey, m on each axis.")
    survey_sd_deg: float = Field(5, gt=0, description="Prior on yaw and pitch about the nominal ones, degrees.")
    roll_sd_deg: float = Field(2.9, gt=0, description="Prior on the roll of a tripod about level, degrees.")
    survey_weight: float = Field(0.05, ge=0, description="Sum of IoU that one unit of the prior's chi squared costs.")

    # Search for a view's pose without a start.
    distance_m: tuple[float, float] = Field((1.0, 7.0), description="Horizontal distance from the origin, m.")
    distance_step_m: float = Field(0.3, gt=0, description="Step of the search in distance, m.")
    azimuth_range_deg: float = Field(12, ge=0, description="Search this far about the surveyed azimuth, degrees.")
    azimuth_step_deg: float = Field(4, gt=0, description="Step of the search in azimuth, degrees.")
    height_m: tuple[float, float] = Field((0.8, 2.0), description="Height above the median rock, m.")
    height_step_m: float = Field(0.2, gt=0, description="Step of the search in height, m.")
    starts: int = Field(25, ge=1, description="Best hypotheses that are refined.")
    search_sd_px: float = Field(40, gt=0, description="Tolerance of box centres in the search, px.")

    # Refinement on box edges.
    start_gates_px: tuple[float, ...] = Field((120, 80, 50, 35, 25, 25), description="Gates of re-assignment, px.")
    final_gates_px: tuple[float, ...] = Field((60, 40, 30, 30), description="Gates of the last fit, px.")
    start_edge_sd_px: float = Field(6, gt=0, description="Noise of a box edge in the first fits, px.")
    edge_sd_px: float = Field(3, gt=0, description="Noise of a box edge in the last fit, px.")
    border_px: float = Field(3, ge=0, description="Edges this near to the photo's border are not measured, px.")
    rock_shift_sd_mm: float = Field(
        7,
        ge=0,
        description="Prior on how far published rock meshes lie off their places, mm on each axis; 0: not at all.",
    )
    match_gate_px: float = Field(40, gt=0, description="Largest distance of a reported match, px.")
    min_boxes: int = Field(3, ge=2, description="Positions with fewer boxes or meshes are placed by the survey.")
    min_fit: float = Field(0.52, gt=0, lt=1, description="Sum of IoU over what could match that speaks for itself.")
    min_led_fit: float = Field(0.4, gt=0, lt=1, description="... and that suffices with a clear lead.")
    min_lead: float = Field(0.15, gt=0, lt=1, description="Such a lead over the next best pose, in the same measure.")
    max_off_survey_m: float = Field(1, gt=0, description="A pose further from the surveyed place is refused, m.")

    # Scans.
    voxel_mm: float = Field(12, gt=0, description="Grid to which scans are thinned for the last alignment, mm.")
    map_step_mm: float = Field(20, gt=0, description="Grid of the height maps that are correlated, mm.")
    scan_yaw_range_deg: float = Field(15, gt=0, le=180, description="Search of yaw between scans, degrees.")
    scan_yaw_step_deg: float = Field(1, gt=0, description="Step of that search, degrees.")
    scan_shift_m: float = Field(1.0, gt=0, description="Search of shifts between scans along x and y, m.")
    scan_candidates: int = Field(5, ge=1, description="Best correlations that are tried by ICP.")
    scan_radius_m: float = Field(3.2, gt=0, description="Scans are used this far about the terrain's centre, m.")
    same_surface_mm: float = Field(10, gt=0, description="Points of two scans nearer than this lie on one surface, mm.")
    min_fitness: float = Field(0.5, gt=0, lt=1, description="Part of the overlap that must agree between scans.")
    min_likeness: float = Field(
        0.5,
        ge=-1,
        lt=1,
        description="Correlation of the relief of two scans below which they show different terrains; 0.9 is usual.",
    )

    # Photos: meshes shaded at the located poses are looked for in them.
    photo_scales: tuple[float, ...] = Field(
        (0.25, 0.5), description="Sizes of the shaded views over the photos', coarse to fine; none: no refinement."
    )
    photo_window_px: int = Field(21, ge=7, description="Side of the windows that are looked for, px of a shaded view.")
    photo_search_px: int = Field(5, ge=2, description="... so far to each side, px of a shaded view.")
    photo_step_px: int = Field(12, ge=1, description="Step between windows, px of a shaded view.")
    photo_likeness: float = Field(0.6, gt=0, lt=1, description="Least correlation of a window with a photo.")
    lamp_sd_mm: float = Field(150, gt=0, description="Prior on a Sun lamp's place about the survey, mm.")
    photo_min_windows: int = Field(200, ge=10, description="Positions with fewer windows found stay as located.")
    photo_noise: float = Field(
        0.4, gt=0, description="Noise of a window's place over sqrt((1 - correlation) / bend of the correlation)."
    )
    photo_independent: int = Field(300, ge=1, description="Windows of a view that at most count: neighbours err alike.")
    photo_pose_sd_mm: float = Field(3, gt=0, description="Prior on a located tripod's place, mm on each axis.")
    photo_pose_sd_deg: float = Field(0.1, gt=0, description="Prior on its direction, degrees about each axis.")
    rig_sd_mm: float = Field(0.5, gt=0, description="Prior on the calibrated baseline, mm on each axis.")
    rig_sd_deg: float = Field(0.02, gt=0, description="Prior on the calibrated turn between cameras, degrees an axis.")
    focal_sd_px: float = Field(1.5, gt=0, description="Prior on calibrated focal lengths, px.")
    centre_sd_px: float = Field(1.5, gt=0, description="Prior on calibrated principal points, px on each axis.")
    k1_sd: float = Field(0.003, gt=0, description="Prior on the calibrated distortion term k1.")
