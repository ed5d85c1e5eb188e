"""JSON files of stereo rigs: `calibration.json` (lenses, relative pose) and `PosX.json` (also pose in the sandbox)."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from polarsim.errors import FormatError, with_path
from polarsim.formats.files import read_json, write_json
from polarsim.formats.readers import reader
from polarsim.geometry.camera import Camera
from polarsim.geometry.lens import Lens
from polarsim.geometry.poses import Pose
from polarsim.geometry.stereo import StereoRig
from polarsim.site_parts import RigLamp

MAX_SIDE_PX = 1 << 16  # maximum width and height of a photo
SURVEYED = "survey"  # method of a rig that is placed at the surveyed pose
PITCH_SD = "pitch_sd_deg"  # metric of a surveyed rig: standard deviation of the pitch
KNOWN_PITCH_DEG = 1.5  # maximum standard deviation of a known pitch
UNCERTAIN_LABELS = "labels, unsure"  # method of a rig with an uncertain pose from labels
FRAME_OF_SURVEY = ", tripods"  # end of the method of scans without walls: the surveyed tripods define the frame
STEREO = "stereo"  # method of a rig that is localised by range maps from stereo photos
FEATURES = "features"  # method of a rig that is localised by features of photos from other positions


@dataclass(frozen=True)
class LocalisedRig:
    """Stereo rig in the sandbox, with the method and metrics of the localisation."""

    rig: StereoRig
    sandbox_from_left: Pose
    # "scans", STEREO, "labels", FEATURES, UNCERTAIN_LABELS or SURVEYED; FRAME_OF_SURVEY if the scans show no walls;
    # ", photos" after a refinement
    method: str = ""
    metrics: dict[str, float] = field(default_factory=dict)  # metrics of the fit; keys carry their units

    @property
    def unproven(self) -> bool:
        """Whether the pose is only surveyed or uncertain, so that no label or mesh may be checked against it."""
        return self.method in (SURVEYED, UNCERTAIN_LABELS)

    @property
    def pitch_known(self) -> bool:
        """Whether the pitch was measured, not assumed from other terrains."""
        return self.method != SURVEYED or self.metrics.get(PITCH_SD, np.inf) <= KNOWN_PITCH_DEG

    def sandbox_from(self, camera: str) -> Pose:
        """Return the pose of camera L or R in the sandbox."""
        return self.sandbox_from_left @ self.rig.left_from(camera)

    def rover_light(self, lamp: RigLamp) -> np.ndarray:
        """Return the position (3,) of the rover light in the sandbox frame."""
        return self.sandbox_from_left.apply(np.array(lamp.from_camera_m))

    def camera(self, side: str) -> Camera:
        """Return camera L or R in the sandbox."""
        return Camera(self.sandbox_from(side), self.rig.lens(side))

    def project(self, camera: str, points_sandbox: np.ndarray) -> np.ndarray:
        """Project sandbox points (..., 3) to pixels (..., 2) of camera L or R; NaN for points with negative depth."""
        return self.camera(camera).project(points_sandbox)


def write_rig(path: str | Path, rig: StereoRig, source: str) -> None:
    """Write a calibration; `source` is the name of the original file or `stated`."""
    write_json(path, {**_rig_content(rig), "source": source})


@reader("calibration", largest_mb=1)
def read_rig(path: str | Path) -> StereoRig:
    """Read `calibration.json`."""
    with with_path(path):
        return _rig(read_json(path))


def write_localised(path: str | Path, localised: LocalisedRig) -> None:
    content = {
        **_rig_content(localised.rig),
        "sandbox_from_left": localised.sandbox_from_left.matrix.tolist(),
        "method": localised.method,
        "metrics": localised.metrics,
    }
    write_json(path, content)


@reader("rig pose", largest_mb=1)
def read_localised(path: str | Path) -> LocalisedRig:
    """Read `PosX.json`."""
    content = read_json(path)
    with with_path(path):
        try:
            matrix = np.array(content["sandbox_from_left"], float)
        except (KeyError, TypeError, ValueError) as error:
            raise FormatError(f"sandbox_from_left is missing or invalid, expected 4 x 4 numbers: {error}") from error
        method, metrics = content.get("method", ""), content.get("metrics", {})
        return LocalisedRig(_rig(content), Pose.from_matrix(matrix), method, metrics)


def localised_files(folder: str | Path) -> dict[str, Path]:
    """Return every `PosX.json` in the folder of a terrain, by position."""
    return {path.stem.removeprefix("Pos"): path for path in sorted(Path(folder).glob("Pos*.json"))}


@reader("rig poses")
def read_all_localised(folder: str | Path) -> dict[str, LocalisedRig]:
    """Read all localised rigs in the folder of a terrain, by position."""
    return {position: read_localised(path) for position, path in localised_files(folder).items()}


def _rig_content(rig: StereoRig) -> dict[str, Any]:
    return {
        "left": lens_content(rig.left),
        "right": lens_content(rig.right),
        "left_from_right": rig.left_from_right.matrix.tolist(),
    }


def lens_content(lens: Lens) -> dict[str, Any]:
    """Return the JSON content of a lens."""
    return {
        "fx_px": lens.fx,
        "fy_px": lens.fy,
        "cx_px": lens.cx,
        "cy_px": lens.cy,
        "distortion": list(lens.distortion),
        "width_px": lens.width,
        "height_px": lens.height,
        "pixel_centre": "integer + 0.5",
    }


def _rig(content: dict[str, Any]) -> StereoRig:
    try:
        left, right = (lens_of(content[name]) for name in ("left", "right"))
        matrix = np.array(content["left_from_right"], float)
    except (KeyError, TypeError, ValueError) as error:
        raise FormatError(f"no rig: {error!r} is missing or not a number") from error
    return StereoRig(left, right, Pose.from_matrix(matrix))


def lens_of(content: dict[str, Any]) -> Lens:
    """Return the lens of a JSON content, the inverse of `lens_content`."""
    k1, k2, p1, p2, k3 = (float(term) for term in content["distortion"])
    lens = Lens(
        float(content["fx_px"]),
        float(content["fy_px"]),
        float(content["cx_px"]),
        float(content["cy_px"]),
        (k1, k2, p1, p2, k3),
        width=int(content["width_px"]),
        height=int(content["height_px"]),
    )
    if not np.isfinite([lens.fx, lens.fy, lens.cx, lens.cy, *lens.distortion]).all():
        raise FormatError("a number of the lens is not finite")
    if min(lens.fx, lens.fy) <= 0 or not (0 < lens.width <= MAX_SIDE_PX and 0 < lens.height <= MAX_SIDE_PX):
        raise FormatError(f"impossible lens of {lens.width} x {lens.height} px with focal length {lens.fx:g} px")
    return lens
