"""Reward and observation of a learner's task."""

from __future__ import annotations

from pydantic import BaseModel, Field, PositiveFloat


class RewardOptions(BaseModel, extra="forbid", frozen=True):
    """Weights of the terms of a step's reward."""

    progress_1_m: float = Field(1.0, description="Reward per metre of progress along the line to the goal.")
    collision: float = Field(-5.0, le=0, description="Reward for a new contact with a rock above 10 cm.")
    energy_1_j: float = Field(-0.001, le=0, description="Reward per joule of motor work.")
    failure: float = Field(
        -10.0, le=0, description="Reward for leaving the grid, turning upside down or a failure of the physics."
    )


class CropOptions(BaseModel, extra="forbid", frozen=True):
    """Crop of the map around the rover, with the rover's heading up."""

    cells: int = Field(48, ge=8, description="Cells along each side of the crop.")
    ahead_m: PositiveFloat = Field(5.4, description="Extent of the crop ahead of base_link, m.")


class TaskOptions(BaseModel, extra="forbid", frozen=True):
    """Task of a learner."""

    top_speed_m_s: PositiveFloat = Field(0.4, le=2.0, description="Speed of a speed action of 1, m/s.")
    top_steer_deg: float = Field(
        30.0, gt=0, lt=90, description="Steering angle to the left of a steering action of 1, degrees."
    )
    settle_s: float = Field(1.0, ge=0, description="Time at rest before an episode, in which the rover settles, s.")
    reward: RewardOptions = Field(RewardOptions(), description="Weights of the reward.")
    crop: CropOptions = Field(CropOptions(), description="Crop of the map.")
