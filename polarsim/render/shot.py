"""What makes one picture of a scene, beside its surfaces and options."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from polarsim.geometry.lens import Lens
from polarsim.geometry.poses import Pose
from polarsim.render.lamps import Lamp
from polarsim.render.options import Model


@dataclass(frozen=True)
class Shot:
    """What makes a picture of a scene.

    Parameters
    ----------
    sandbox_from_camera : Pose
        `geometry.poses.looking` makes one from a place and angles.
    lens : Lens
        `lens.scaled(0.25)` renders a small picture.
    lamps : name -> Lamp
        Near points or discs of light, or `Lamp.sun`; any names. None: black.
    exposure_ms : float
        Exposure time, ms.
    model : str
        One of `render.options.MODELS`; its parameters and gain are those of the scene's options.
    """

    sandbox_from_camera: Pose
    lens: Lens
    lamps: Mapping[str, Lamp]
    exposure_ms: float
    model: Model
