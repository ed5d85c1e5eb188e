"""What the configuration says about bags."""

from __future__ import annotations

from typing import Literal

from pydantic import BaseModel, Field, PositiveFloat

from polarsim.render.options import Model


class BagOptions(BaseModel, extra="forbid", frozen=True):
    """These options say how a drive becomes messages of ROS 2 in an MCAP file."""

    start_s: int = Field(
        1, ge=0, description="The drive's first instant has this time stamp, s; 0 means `the latest` to tf2."
    )
    state_hz: PositiveFloat = Field(
        50, description="Transforms, odometry, joints and wheels are written at this rate, 1/s."
    )
    imu_hz: PositiveFloat = Field(100, description="Both IMU topics are written at this rate, 1/s.")
    accelerometer_sd_m_s2: float = Field(
        0.01, ge=0, description="A reading of acceleration on /imu has this noise (sd), m/s2."
    )
    gyroscope_sd_rad_s: float = Field(
        0.001, ge=0, description="A reading of the angular rate on /imu has this noise (sd), rad/s."
    )
    height_hz: float = Field(
        0.5, ge=0, description="The ground's heights are written at this rate, 1/s; 0: not at all."
    )
    height_cell_m: PositiveFloat = Field(
        0.06, description="Heights have cells of this side, m; at least that of the ground."
    )
    sun: str = Field("1", description="Pictures, truth and detections under this Sun go into the bag.")
    model: Model = Field("hapke", description="Pictures of this reflectance model go into the bag.")
    exposure_ms: PositiveFloat = Field(256, description="Pictures with this exposure go into the bag, ms.")
    images: bool = Field(True, description="Pictures go into the bag, as the PNG files they are.")
    compression: Literal["zstd", "lz4", "none"] = Field(
        "zstd", description="Chunks of the bag are compressed like this."
    )

    def stamp_ns(self, time_s: float) -> int:
        """A time of the drive's clock as bags have it."""
        return self.start_s * 1_000_000_000 + round(time_s * 1e9)
