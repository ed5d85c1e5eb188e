"""What a user may vary of the analog sandbox. The defaults are what is known or assumed of NASA's."""

from __future__ import annotations

from pydantic import BaseModel, Field


class AnalogOptions(BaseModel, extra="forbid", frozen=True):
    """The sandbox, its scanner, its photographer and its annotator. Same options and seed, same bytes."""

    seed: int = Field(1, description="Run seed of everything random.")
    photos: bool = Field(True, description="Whether photos, seeds and true labels are made; false leaves scans only.")

    ground_step_mm: float = Field(5.0, ge=2, le=20, description="Grid step of the sand's relief, mm.")
    rock_detail: int = Field(5, ge=3, le=6, description="Subdivisions of the icosahedron that rocks are carved from.")
    truth_ground_step_mm: float = Field(15.0, ge=5, le=50, description="Grid step of the ground mesh in truth/, mm.")

    tripod_offset_mm: float = Field(100, ge=0, le=500, description="Tripods stand up to this far off nominal, mm.")
    tripod_turn_deg: float = Field(2.0, ge=0, le=10, description="Yaw is off nominal by up to this, degrees.")
    tripod_roll_deg: float = Field(1.0, ge=0, le=10, description="Roll of the rig up to this, degrees.")
    pitch_from_deg: float = Field(22.0, ge=10, le=40, description="Smallest tilt of the rig downwards, degrees.")
    pitch_to_deg: float = Field(28.0, ge=10, le=40, description="Largest tilt of the rig downwards, degrees.")
    lamp_offset_from_mm: float = Field(100, ge=0, le=500, description="Least distance of a lamp from its survey, mm.")
    lamp_offset_to_mm: float = Field(200, ge=0, le=500, description="Largest distance of a lamp from its survey, mm.")
    lamp_radius_mm: float = Field(45, ge=0, le=300, description="Radius of a lamp's bright disc, mm.")

    focal_error_px: float = Field(1.0, ge=0, description="Error of focal lengths in the calibration file (sd), px.")
    principal_error_px: float = Field(1.0, ge=0, description="Error of principal points there (sd), px.")
    k1_error: float = Field(0.002, ge=0, description="Error of the distortion term k1 there (sd).")
    baseline_error_mm: float = Field(0.2, ge=0, description="Error of each part of the baseline there (sd), mm.")

    range_noise_mm: float = Field(2.0, ge=0, le=50, description="Scanner's noise along the ray (sd), mm.")
    scan_step_deg: float = Field(0.072, gt=0.02, le=1, description="Scanner's angular step, degrees.")
    mixed_pixels: float = Field(0.5, ge=0, le=1, description="Share of scan points at depth edges that hang between.")
    scanner_offset_mm: float = Field(60, ge=0, le=500, description="Scanner from the left camera's place (sd), mm.")
    registration_error_mm: float = Field(2.0, ge=0, le=50, description="Shift of NASA's map registration (sd), mm.")
    registration_error_deg: float = Field(0.05, ge=0, le=2, description="Turn of NASA's map registration (sd), deg.")

    hall_light_dn_per_s: float = Field(1.2, ge=0, description="Sand's brightness in the dark hall, DN a second.")
    full_well_electrons: float = Field(33000, gt=0, description="Full well of a pixel, electrons.")
    read_noise_electrons: float = Field(7.0, ge=0, description="Read noise (sd), electrons.")
    electrons_per_dn: float = Field(8.0, gt=0, description="Gain, electrons per DN.")

    shadows_from_ms: int = Field(128, ge=16, description="The annotator draws shadows from this exposure on, ms.")
