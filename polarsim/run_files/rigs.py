"""Our JSON files of rigs: `calibration.json` (lenses and the pose between them) and `PosX.json` (where a rig stood)."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from polarsim.errors import FormatError, about
from polarsim.formats.files import read_json, write_json
from polarsim.formats.readers import reader
from polarsim.geometry.camera import Camera
from polarsim.geometry.lens import Lens
from polarsim.geometry.poses import Pose
from polarsim.geometry.stereo import StereoRig
from polarsim.survey import ROVER_LIGHT_FROM_LEFT, survey_lift

MOST_PX = 1 << 16  # width or height of a photo
SURVEYED = "survey"  # method of a rig that nothing else localises
PITCH_SD = "pitch_sd_deg"  # metric of a surveyed rig: how well its pitch is known
KNOWN_PITCH_DEG = 1.5  # standard deviation up to which a pitch is known
UNSURE = "labels, unsure"  # of one whose pose labels suggest and do not prove
FEATURES = "features"  # of one that photos from localised positions localise


@dataclass(frozen=True)
class LocalisedRig:
    """A rig in the sandbox, and what is known about how well it was localised."""

    rig: StereoRig
    sandbox_from_left: Pose
    method: str = ""  # "scans", "labels", FEATURES, UNSURE or SURVEYED, ", photos" behind it: what the pose rests on
    metrics: dict[str, float] = field(default_factory=dict)  # metrics of the fit; keys carry their units

    @property
    def unproven(self) -> bool:
        """Whether the pose is the survey's or a guess: nothing that rests on it is evidence, no mesh is seen by it."""
        return self.method in (SURVEYED, UNSURE)

    @property
    def pitch_known(self) -> bool:
        """Whether anything but habit tells how far down the cameras look."""
        return self.method != SURVEYED or self.metrics.get(PITCH_SD, np.inf) <= KNOWN_PITCH_DEG

    def sandbox_from(self, camera: str) -> Pose:
        """Pose of camera L or R in the sandbox."""
        return self.sandbox_from_left @ self.rig.left_from(camera)

    @property
    def rover_light(self) -> np.ndarray:
        """(3,) position of the rover light in the sandbox."""
        return self.sandbox_from_left.apply(ROVER_LIGHT_FROM_LEFT)

    def camera(self, side: str) -> Camera:
        """Camera L or R in the sandbox."""
        return Camera(self.sandbox_from(side), self.rig.lens(side))

    def project(self, camera: str, points_sandbox: np.ndarray) -> np.ndarray:
        """Pixels (..., 2) of sandbox points (..., 3) in camera L or R; NaN behind the camera."""
        return self.camera(camera).project(points_sandbox)


def write_rig(path: str | Path, rig: StereoRig, source: str) -> None:
    """`source` says where the calibration comes from: a file's name or `stated`."""
    write_json(path, {**_rig_content(rig), "source": source})


@reader("calibration", largest_mb=1)
def read_rig(path: str | Path) -> StereoRig:
    """Read `calibration.json`.

    Raises
    ------
    FormatError
        Something is missing or is no rig.
    """
    with about(path):
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
    """Read `PosX.json`.

    Raises
    ------
    FormatError
        Something is missing or is no localised rig.
    """
    content = read_json(path)
    with about(path):
        try:
            matrix = np.array(content["sandbox_from_left"], float)
        except (KeyError, TypeError, ValueError) as error:
            raise FormatError(f"no sandbox_from_left of 4 x 4 numbers, {error}") from error
        method, metrics = content.get("method", ""), content.get("metrics", {})
        return LocalisedRig(_rig(content), Pose.from_matrix(matrix), method, metrics)


def localised_files(folder: str | Path) -> dict[str, Path]:
    """Every `PosX.json` of a terrain's folder, by position."""
    return {path.stem.removeprefix("Pos"): path for path in sorted(Path(folder).glob("Pos?.json"))}


@reader("rig poses")
def read_all_localised(folder: str | Path) -> dict[str, LocalisedRig]:
    """What `localised_files` hold, by position."""
    return {position: read_localised(path) for position, path in localised_files(folder).items()}


def lift_of(localised: Mapping[str, LocalisedRig]) -> float:
    """How much higher than usual the survey lies in the frame of a terrain's rigs, metres: see `survey_lift`."""
    return survey_lift({position: rig.sandbox_from_left.translation for position, rig in localised.items()})


def _rig_content(rig: StereoRig) -> dict[str, Any]:
    return {
        "left": lens_content(rig.left),
        "right": lens_content(rig.right),
        "left_from_right": rig.left_from_right.matrix.tolist(),
    }


def lens_content(lens: Lens) -> dict[str, Any]:
    """A lens as our JSON files have it."""
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
        raise FormatError(f"no rig: {error!r} is missing or no number") from error
    return StereoRig(left, right, Pose.from_matrix(matrix))


def lens_of(content: dict[str, Any]) -> Lens:
    """The inverse of `lens_content`."""
    k1, k2, p1, p2, k3 = (float(term) for term in content["distortion"])
    return checked_lens(
        Lens(
            float(content["fx_px"]),
            float(content["fy_px"]),
            float(content["cx_px"]),
            float(content["cy_px"]),
            (k1, k2, p1, p2, k3),
            int(content["width_px"]),
            int(content["height_px"]),
        )
    )


def checked_lens(lens: Lens) -> Lens:
    """The lens.

    Raises
    ------
    FormatError
        A number that is not finite, or a focal length or size that no lens has.
    """
    if not np.isfinite([lens.fx, lens.fy, lens.cx, lens.cy, *lens.distortion]).all():
        raise FormatError("a lens with a number that is not finite")
    if min(lens.fx, lens.fy) <= 0 or not (0 < lens.width <= MOST_PX and 0 < lens.height <= MOST_PX):
        raise FormatError(f"a lens of {lens.width} x {lens.height} px with the focal length {lens.fx:g} px")
    return lens
