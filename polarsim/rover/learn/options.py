"""What a learner's task is worth and what it is shown."""

from __future__ import annotations

from pydantic import BaseModel, Field, PositiveFloat


class RewardOptions(BaseModel, extra="forbid", frozen=True):
    """The reward of a step is a sum of these."""

    progress_1_m: float = Field(1.0, description="A metre gained along the straight line to the goal earns this.")
    collision: float = Field(
        -5.0, le=0, description="Touching a rock above 10 cm that was not touched a step before costs this."
    )
    energy_1_j: float = Field(-0.001, le=0, description="A joule that the motors take costs this.")
    failure: float = Field(
        -10.0, le=0, description="Leaving the grid, lying upside down or breaking the physics costs this."
    )


class CropOptions(BaseModel, extra="forbid", frozen=True):
    """The map is shown cut out around the rover, turned so that ahead is up."""

    cells: int = Field(48, ge=8, description="The crop has so many of the map's cells along each side.")
    ahead_m: PositiveFloat = Field(5.4, description="The crop reaches so far ahead of base_link, m.")


class TaskOptions(BaseModel, extra="forbid", frozen=True):
    """These options set a learner's task."""

    top_speed_m_s: PositiveFloat = Field(0.4, le=2.0, description="An action of speed 1 is this speed, m/s.")
    top_steer_deg: float = Field(
        30.0, gt=0, lt=90, description="An action of steering 1 is this angle to the left, degrees."
    )
    settle_s: float = Field(1.0, ge=0, description="The rover sinks in at rest for this long before an episode, s.")
    reward: RewardOptions = Field(RewardOptions(), description="This section sets the reward.")
    crop: CropOptions = Field(CropOptions(), description="This section sets the crop of the map.")
