"""All options of the rover: which drives a run makes, and those of each step."""

from __future__ import annotations

from pydantic import BaseModel, Field, field_validator, model_validator

from polarsim.rover.cameras.layout import picture_set
from polarsim.rover.cameras.options import REAL, CameraSuiteOptions
from polarsim.rover.drive.options import DriveOptions
from polarsim.rover.export.options import BagOptions
from polarsim.rover.perception.options import DriveTuningOptions
from polarsim.rover.planning.options import AutonomyOptions
from polarsim.rover.soil.options import SoilOptions
from polarsim.rover.vehicle.mounts import FOLLOWING, FRONT
from polarsim.rover.world.options import WorldOptions


class RoverOptions(BaseModel, extra="forbid", frozen=True):
    """The rover drives over a run's terrains: physics by seed, pictures by view and Sun, finds on board, bags."""

    run: bool = Field(
        False, description="The rover drives; without it the run has no rover, and nothing else of it changes."
    )
    seeds: tuple[int, ...] = Field(
        (0,), min_length=1, description="There is a drive for each of these seeds; start, ground and noise differ."
    )
    detector: str | None = Field(
        None,
        description="The run's detector of this training domain looks through the front camera; none: truth "
        "alone is measured.",
    )
    fine_tuning: DriveTuningOptions = Field(
        DriveTuningOptions(), description="The detector on board is trained on pictures of other drives first."
    )
    bags: bool = Field(True, description="Every drive is written as an MCAP file of ROS 2 messages.")
    world: WorldOptions = Field(WorldOptions(), description="This section describes the ground that is driven over.")
    soil: SoilOptions = Field(SoilOptions(), description="This section sets the soil and its law.")
    drive: DriveOptions = Field(
        DriveOptions(), description="This section says where the rover goes and how it is steered."
    )
    cameras: CameraSuiteOptions = Field(
        CameraSuiteOptions(),
        description="This section says which pictures are made, and what is made of them on board.",
    )
    autonomy: AutonomyOptions = Field(AutonomyOptions(), description="The rover finds its own way in these drives.")
    bag: BagOptions = Field(BagOptions(), description="This section says what goes into the bags.")

    @field_validator("seeds")
    @classmethod
    def _each_once(cls, values: tuple[int, ...]) -> tuple[int, ...]:
        if len(set(values)) < len(values) or min(values) < 0:
            raise ValueError("seeds are 0 or more, each once")
        return values

    @model_validator(mode="after")
    def _bag_of_pictures(self) -> RoverOptions:
        suite, bag = self.cameras, self.bag
        for name, value, known in (
            ("sun", bag.sun, self.suns),
            ("model", bag.model, suite.models),
            ("exposure_ms", bag.exposure_ms, suite.exposures_ms),
        ):
            if self.run and self.bags and value not in known:
                raise ValueError(f"bag.{name}: {value!r} is not among rover.cameras', {', '.join(map(str, known))}")
        return self

    @property
    def suns(self) -> tuple[str, ...]:
        """Names of all Suns."""
        return (*self.cameras.suns, *([REAL] if self.cameras.real_sun else []))

    @property
    def picture_sets(self) -> tuple[str, ...]:
        """Names of the sets of pictures that every view has."""
        return tuple(picture_set(sun, *what) for sun in self.suns for what in self.cameras.pictures)

    @property
    def shown_set(self) -> str:
        """The set that figures show: that of the bags where there are some, else the first."""
        chosen = picture_set(self.bag.sun, self.bag.model, self.bag.exposure_ms)
        return chosen if chosen in self.picture_sets else self.picture_sets[0]

    @property
    def shown_view(self) -> str:
        """The view that the figure of the drive shows: one that follows the rover where there is one."""
        return next((view for view in self.cameras.views if view in FOLLOWING), self.cameras.views[0])

    @property
    def onboard(self) -> bool:
        """Whether the front camera takes pictures: what is seen on board is seen by it."""
        return FRONT in self.cameras.views
