"""Options of the rover's drives."""

from __future__ import annotations

from pydantic import BaseModel, Field, field_validator, model_validator

from polarsim.rover.cameras.options import CameraSuiteOptions
from polarsim.rover.drive.options import DriveOptions
from polarsim.rover.export.options import BagOptions
from polarsim.rover.perception.options import DriveTuningOptions
from polarsim.rover.planning.options import AutonomyOptions
from polarsim.rover.soil.options import SoilOptions
from polarsim.rover.vehicle.camera_names import FOLLOWING, FRONT
from polarsim.rover.world.options import WorldOptions
from polarsim.run_files.picture_sets import PictureSet


class RoverOptions(BaseModel, extra="forbid", frozen=True):
    """Drives over the terrains of a run: physics, pictures, onboard detections, bags."""

    run: bool = Field(False, description="Make drives. Does not affect the rest of the run.")
    seeds: tuple[int, ...] = Field(
        (0,), min_length=1, description="Random seeds, a drive for each; start, ground and noise differ."
    )
    detector: str | None = Field(
        None,
        description="Training domain of the run's onboard detector. None: `cameras.onboard.weights`.",
    )
    fine_tuning: DriveTuningOptions = Field(
        DriveTuningOptions(), description="Fine-tuning of the onboard detector with pictures of other drives."
    )
    bags: bool = Field(True, description="Write every drive as an MCAP file of ROS 2 messages.")
    world: WorldOptions = Field(WorldOptions(), description="Ground of the drives.")
    soil: SoilOptions = Field(SoilOptions(), description="Soil and its contact law.")
    drive: DriveOptions = Field(DriveOptions(), description="Path, control and steering.")
    cameras: CameraSuiteOptions = Field(CameraSuiteOptions(), description="Pictures and onboard detector.")
    autonomy: AutonomyOptions = Field(AutonomyOptions(), description="Drives with a path planned by the rover.")
    bag: BagOptions = Field(BagOptions(), description="Content of the bags.")

    @field_validator("seeds")
    @classmethod
    def _each_once(cls, values: tuple[int, ...]) -> tuple[int, ...]:
        if len(set(values)) < len(values) or min(values) < 0:
            raise ValueError("seeds must be distinct and not negative")
        return values

    @model_validator(mode="after")
    def _bag_of_pictures(self) -> RoverOptions:
        suite, bag = self.cameras, self.bag
        for name, value, known in (
            ("sun", bag.sun, suite.suns),
            ("model", bag.model, suite.models),
            ("exposure_ms", bag.exposure_ms, suite.exposures_ms),
        ):
            if self.run and self.bags and value not in known:
                raise ValueError(f"bag.{name}: {value!r}, rover.cameras has {', '.join(map(str, known))}")
        return self

    @property
    def picture_sets(self) -> tuple[str, ...]:
        """Names of the picture sets of each view."""
        return tuple(str(PictureSet(sun, *what)) for sun in self.cameras.suns for what in self.cameras.pictures)

    @property
    def shown_set(self) -> str:
        """Picture set of the drive's figures: that of the bags if it exists, otherwise the first."""
        chosen = str(PictureSet(self.bag.sun, self.bag.model, self.bag.exposure_ms))
        return chosen if chosen in self.picture_sets else self.picture_sets[0]

    @property
    def shown_view(self) -> str:
        """View of the drive's figure: a view that follows the rover if there is one, otherwise the first."""
        return next((view for view in self.cameras.views if view in FOLLOWING), self.cameras.views[0])

    @property
    def onboard(self) -> bool:
        """Whether the front camera, the input of the onboard detector, is rendered."""
        return FRONT in self.cameras.views
