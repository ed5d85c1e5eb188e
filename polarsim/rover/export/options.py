"""Options of bags."""

from __future__ import annotations

from pydantic import BaseModel, Field, PositiveFloat

from polarsim.render.options import Model


class BagOptions(BaseModel, extra="forbid", frozen=True):
    """ROS 2 messages in a drive's MCAP file."""

    sun: str = Field("1", description="Sun of the pictures, ground truth and detections in the bag.")
    model: Model = Field("hapke", description="Reflectance model of the pictures in the bag.")
    exposure_ms: PositiveFloat = Field(256, description="Exposure of the pictures in the bag, ms.")
    images: bool = Field(True, description="Include the pictures, as PNG.")
    height_hz: float = Field(0.5, ge=0, description="Rate of the ground's heights, 1/s; 0: no heights.")
