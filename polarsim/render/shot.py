"""What makes one picture of a scene, beside its surfaces and options."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from polarsim.geometry.camera import Camera
from polarsim.render.lamps import Lamp
from polarsim.render.options import Model


@dataclass(frozen=True)
class Shot:
    """What makes a picture of a scene.

    Parameters
    ----------
    camera : Camera
        In the sandbox; `geometry.poses.looking` makes a pose from a place and angles, `camera.scaled(0.25)` renders a
        small picture.
    lamps : name -> Lamp
        Near points or discs of light, or `Lamp.sun`; any names. None: black.
    exposure_ms : float
        Exposure time, ms.
    model : str
        One of `render.options.MODELS`; its parameters and gain are those of the scene's options.
    """

    camera: Camera
    lamps: Mapping[str, Lamp]
    exposure_ms: float
    model: Model
