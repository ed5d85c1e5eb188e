"""Stages that a run can do at its site, and the reasons why it cannot do the others."""

from __future__ import annotations

from dataclasses import dataclass

from polarsim.acquire.options import SeedOptions
from polarsim.config import Config
from polarsim.photo import terrain_text
from polarsim.site import polar


@dataclass(frozen=True)
class StageState:
    """Whether a stage is possible, and the reason or the method."""

    stage: str
    possible: bool
    reason: str

    def line(self) -> str:
        """Return a line of text."""
        return f"{self.stage}: {'possible' if self.possible else 'not possible'}, {self.reason}"


def stage_states(config: Config) -> list[StageState]:
    """Return the state of each stage in the order of the pipeline."""
    site, data = config.site, config.data_source
    stereo = site.cameras.stereo
    cameras = _cameras(config)
    meshes = cameras.possible or not data.has_scans
    rocks = _if(
        meshes, "published meshes" if not data.has_scans else _ranges(config), "the cameras stage is not possible"
    )
    of_labels = "seeds are propagated" if isinstance(config.labels.seeds, SeedOptions) else "without seeds"
    shadows = "" if site.lamps and _has_frame(config) else "; no shadows of lamps, see cameras"
    unsurveyed = [terrain_text(terrain) for terrain in config.terrains if not site.options(terrain).surveyed]
    if unsurveyed and shadows == "":
        shadows = f"; no places of lamps in terrain {', '.join(unsurveyed)}"
    compared = f"photos and twins of {data.domain} data" if data.has_photos else "published photos"
    return [
        _acquire(config),
        cameras,
        StageState("rocks", *rocks),
        StageState("labels", meshes, f"{of_labels}{shadows}" if meshes else "the rocks stage is not possible"),
        StageState("render", *_if(meshes, "every photo under a lamp has a twin", "no meshes")),
        StageState("detect", *_if(meshes, compared, "no labels")),
        StageState("stereo", *_if(stereo and data.has_photos, "two cameras", "no photos" if stereo else "one camera")),
        StageState("rover", *_if(meshes, "drives on the meshes", "no meshes")),
    ]


def plan_lines(config: Config) -> list[str]:
    """Return the stages for the plan of a run, in a few lines; none for NASA's sandbox."""
    if config.site == polar():
        return []
    states = stage_states(config)
    possible = ", ".join(state.stage for state in states if state.possible)
    return [f"site {config.site.name}: possible stages {possible}"] + [
        f"site {config.site.name}: {state.line()}" for state in states if not state.possible
    ]


def _acquire(config: Config) -> StageState:
    site = config.site
    if not site.files.calibration and site.cameras.calibration is None:
        reason = "no calibration: state files.calibration or cameras.calibration"
        return StageState("acquire", False, reason)
    form = "photos are converted to 12 bits" if site.converts_photos else "photos are used in place"
    return StageState("acquire", True, form if config.data_source.has_photos else "published labels and meshes")


def _cameras(config: Config) -> StageState:
    if not config.data_source.has_scans:
        return StageState("cameras", True, "from labels and published meshes")
    if not config.has_ranges:
        return StageState("cameras", False, "no scans and one camera: ranges are unknown")
    return StageState("cameras", True, f"{_ranges(config)}; {_frame(config)}")


def _ranges(config: Config) -> str:
    return "from scans" if config.has_scans else "no scans: ranges are measured in stereo photos"


def _has_frame(config: Config) -> bool:
    """Return whether walls, a raised box or tripods define origin and heading."""
    sandbox = config.site.sandbox
    return sandbox.raised or any(sandbox.walls_m.values()) or bool(config.site.tripods)


def _frame(config: Config) -> str:
    sandbox, tripods = config.site.sandbox, config.site.tripods
    if sandbox.raised:
        return "origin and heading from the box"
    if any(sandbox.walls_m.values()):
        return "origin and heading from walls" if tripods else "origin from walls; no tripods: heading from the camera"
    if tripods:
        return "no walls: origin and heading from tripods"
    return "neither walls nor tripods: origin and heading are arbitrary, and lamps do not fit"


def _if(possible: bool, how: str, reason: str) -> tuple[bool, str]:
    return possible, how if possible else reason
