"""Names of images of randomised scenes."""

from __future__ import annotations

import re

SCENE_NAME = re.compile(r"t(\d\d)_s(\d+)_l\d+")  # terrain, scene


def scene_name(terrain: int, scene: int, lamp: int) -> str:
    """Return the name of an image of a scene with rocks of a terrain, such as `t01_s007_l2`."""
    return f"t{terrain:02d}_s{scene:03d}_l{lamp}"
