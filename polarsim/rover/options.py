"""Options of the rover: the drives of a run and each of their steps."""

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
    """Drives over the terrains of a run: physics, pictures, detections on board, bags."""

    run: bool = Field(False, description="Make drives. Does not affect the rest of the run.")
    seeds: tuple[int, ...] = Field(
        (0,), min_length=1, description="A drive for each of these seeds; start, ground and noise differ."
    )
    detector: str | None = Field(
        None,
        description="Training domain of the run's detector on board. None: `cameras.onboard.weights`.",
    )
    fine_tuning: DriveTuningOptions = Field(
        DriveTuningOptions(), description="Fine-tuning of the detector on board with pictures of other drives."
    )
    bags: bool = Field(True, description="Write every drive as an MCAP file of ROS 2 messages.")
    world: WorldOptions = Field(WorldOptions(), description="Ground of the drives.")
    soil: SoilOptions = Field(SoilOptions(), description="Soil and its contact law.")
    drive: DriveOptions = Field(DriveOptions(), description="Path, control and steering.")
    cameras: CameraSuiteOptions = Field(CameraSuiteOptions(), description="Pictures, and the detector on board.")
    autonomy: AutonomyOptions = Field(AutonomyOptions(), description="Drives in which the rover finds its own way.")
    bag: BagOptions = Field(BagOptions(), description="Content of the bags.")

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
        """Picture set of the figures: that of the bags if it exists, else the first."""
        chosen = picture_set(self.bag.sun, self.bag.model, self.bag.exposure_ms)
        return chosen if chosen in self.picture_sets else self.picture_sets[0]

    @property
    def shown_view(self) -> str:
        """View of the figure of the drive: one that follows the rover, else the first."""
        return next((view for view in self.cameras.views if view in FOLLOWING), self.cameras.views[0])

    @property
    def onboard(self) -> bool:
        """Whether the front camera, which the detector on board uses, takes pictures."""
        return FRONT in self.cameras.views
