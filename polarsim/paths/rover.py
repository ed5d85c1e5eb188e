"""Paths and options of the drives of the rover."""

from __future__ import annotations

from pathlib import Path

from polarsim.formats.files import resolve_packaged
from polarsim.paths.run import RunPaths
from polarsim.paths.wildcards import Options, Wildcards
from polarsim.photo import terrain_text
from polarsim.rover.cameras.options import rover_render
from polarsim.rover.perception.options import OnboardDetector
from polarsim.rover.planning.cases import cases
from polarsim.rover.vehicle.camera_names import FRONT


class RoverPaths:
    """Paths and options of the drives of the rover."""

    def __init__(self, run: RunPaths) -> None:
        self.run, self.config, self.rover = run, run.config, run.config.rover
        rover, folder = self.rover, Path(f"results/{run.run}")
        self.seeds = list(rover.seeds) if rover.run else []
        self.first = f"results/{{run}}/rover/seed{rover.seeds[0]}"  # folder of the drive that figures show
        self.views, self.suns = list(rover.cameras.views), list(rover.cameras.suns)
        self.picture_sets = list(rover.picture_sets)
        self.terrains = [terrain_text(terrain) for terrain in rover.world.terrains]  # from east to west
        self.tables = ["rover", "rover_drives", *(["rover_onboard"] if rover.onboard else [])]
        self.figures = ["rover_sequence", "rover_drive", *(["rover_front"] if rover.onboard else [])]
        self.detector = self.config.detector_on_board(folder)  # None: metrics on board use the ground truth only
        self.detector_before = self.config.detector_before_drives(folder)  # before fine-tuning on other drives
        self.deciding = self.config.deciding_detectors(folder)
        planned = cases(rover.autonomy, rover.cameras, rover.seeds, list(self.deciding))
        self.cases = {case.name: case for case in planned} if rover.run and rover.autonomy.run else {}
        self.cases_without_pictures = [name for name, case in self.cases.items() if not case.has_pictures]
        self.detectors_driven = {case.detector for case in self.cases.values()} & set(self.deciding)
        # Whether the run has metrics of these detectors: it evaluates only detectors that it trains.
        self.has_gap = bool(set(rover.autonomy.detectors) & set(run.trained))

    @property
    def vehicle(self) -> str:
        """The table of the vehicle, in this folder or in the package."""
        return str(resolve_packaged(self.rover.drive.vehicle))

    @property
    def soils(self) -> str:
        """The table of soils, in this folder or in the package."""
        return str(resolve_packaged(self.rover.soil.table))

    @property
    def meshes(self) -> list[str]:
        """The folders of the terrains that are driven over, with closed rocks."""
        return [f"results/{{run}}/{self.config.closed_meshes}/Terrain{terrain}" for terrain in self.terrains]

    @property
    def elevation_model(self) -> str | list[str]:
        """The file of the elevation model that is driven over; empty without a file."""
        dem = self.rover.world.dem
        return str(dem.path) if dem and dem.path else []

    @property
    def weights(self) -> str | list[str]:
        """The weights of the detector on board; empty without a detector."""
        return str(self.detector.weights) if self.detector else []

    @property
    def weights_before_fine_tuning(self) -> str | list[str]:
        """The weights that the training on other drives starts from; empty without a detector."""
        return str(self.detector_before.weights) if self.detector_before else []

    @property
    def shown_sun(self) -> str:
        """The Sun under which figures show a drive."""
        return self.rover.shown_set.split("_")[0]

    def camera_options(self, *excluded: str) -> Options:
        """Return the options of the pictures of a drive without the named ones."""
        return self.rover.cameras.model_dump(mode="json", exclude=set(excluded))

    def detector_options(self) -> Options | None:
        """Return the options of the detector on board; None without a detector."""
        return self._placed(self.detector)

    def validation_options(self) -> Options | None:
        """Return the options of the validation during the training on other drives; None without a detector."""
        return self.run.validation_options(self.detector.prediction) if self.detector else None

    def poses_of_other_drives(self) -> list[str]:
        """Return the last written file of each drive that the detector on board is trained on."""
        return [f"{drive}/{FRONT}/poses.parquet" for drive in self.rover.fine_tuning.drives]

    def pictures_of_drive(self) -> list[str]:
        """Return the camera poses and the labels of every view, which are written together with the pictures."""
        folders = [f"results/{{run}}/rover/seed{{seed}}/{view}" for view in self.views]
        labels = [f"{folder}/{sun}_truth.parquet" for folder in folders for sun in self.suns]
        return [*(f"{folder}/poses.parquet" for folder in folders), *labels]

    def detections(self) -> list[str]:
        """Return the detections in each picture set of the front camera; empty without a detector on board."""
        if not self.rover.onboard or self.detector is None:
            return []
        return [f"results/{{run}}/rover/seed{{seed}}/{FRONT}/{name}/detections.parquet" for name in self.picture_sets]

    def shown_detections(self) -> str | list[str]:
        """Return the detections in the pictures that figures show; empty without a detector on board."""
        return f"{self.first}/{FRONT}/{self.rover.shown_set}/detections.parquet" if self.detector else []

    def width_of_drives(self, wildcards: Wildcards) -> float | None:
        """Return the width of the ground of autonomous drives; None for drives along a path."""
        return self.rover.autonomy.width_m if wildcards.drives == "autonomy" else None

    # Autonomous drives, one per case

    def autonomy_options(self) -> Options:
        """Return the options of a case. More seeds or modes leave finished drives valid, so these are excluded."""
        excluded = {"run", "modes", "headlights", "auto_exposure", "detectors", "poses"}
        return self.rover.autonomy.model_dump(mode="json", exclude=excluded)

    def cameras_of_case(self, wildcards: Wildcards) -> Options:
        """Return the options of cameras that change a drive: of the pictures, if the mode uses them, and of boxes."""
        names = set() if self._is_unlit(wildcards) else {"sun_elevation_deg", "scale", "stars"}
        included = dict.fromkeys(names, True) | {"onboard": {"confidence", "ground"}}
        return self.rover.cameras.model_dump(mode="json", include=included)

    def render_of_case(self, wildcards: Wildcards) -> Options:
        """Return the options of the renderer that change a drive."""
        options = rover_render(self.config.render)
        return {"skirt_m": options["skirt_m"]} if self._is_unlit(wildcards) else options

    def detector_of_case(self, wildcards: Wildcards) -> Options | None:
        """Return the options of the detector of a case; None for a mode without detector."""
        return self._placed(self.deciding.get(self.cases[wildcards.case].detector))

    def weights_of_case(self, wildcards: Wildcards) -> str | list[str]:
        """Return the weights of the detector of a case; empty for a mode without detector."""
        detector = self.deciding.get(self.cases[wildcards.case].detector)
        return str(detector.weights) if detector else []

    def _placed(self, detector: OnboardDetector | None) -> Options | None:
        placed = {"weights": self.run.placed(str(detector.weights))} if detector else {}
        return detector.model_dump(mode="json") | placed if detector else None

    def _is_unlit(self, wildcards: Wildcards) -> bool:
        return not self.cases[wildcards.case].has_pictures
