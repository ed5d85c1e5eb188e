"""Rendering of the demonstration scene of `polarsim render --demo`."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np

from polarsim.analog.rock_scene import TERRAIN, write_rock_scene
from polarsim.formats.files import check_new_folder
from polarsim.render.views.options import Views
from polarsim.render.views.run import render_views
from polarsim.report.views_sheet import draw_views

SEED = 8
AZIMUTHS_DEG, ELEVATION_DEG = (30, 120, 200, 300), 9  # of the Suns; the camera looks towards azimuth 200
LENS = {"kind": "pinhole", "hfov_deg": 55, "width_px": 1280, "height_px": 800}
CAMERA = {"kind": "point", "name": "mast", "position_m": (3.1, 1.3, 1.45), "look_at_m": (-0.2, 0.0, 0.0)}
MODELS = ("principled", "hapke")


def render_demo(out: Path, *, tone: Callable[[np.ndarray], np.ndarray], scale: float, threads: int) -> tuple[int, Path]:
    """Render generated rocks with both models under four Suns; return the number of images and the contact sheet.

    Writes `meshes`, `views` (images, labels, instance maps) and `contact.png` to the new folder `out`. `tone` and
    `scale` are those of `render_views`.
    """
    check_new_folder(out)
    write_rock_scene(out / "meshes", SEED)
    views = Views.model_validate(
        {
            "scenes": [{"name": "rocks", "meshes": out / "meshes", "terrain": TERRAIN}],
            "lens": LENS,
            "cameras": [CAMERA],
            "lights": [{"kind": "sun", "azimuth_deg": AZIMUTHS_DEG, "elevation_deg": [ELEVATION_DEG]}],
            "render": {"models": MODELS, "walls": False},
        }
    )
    count = render_views(views, out / "views", tone=tone, scale=scale, preview=True, threads=threads)
    sheet = out / "contact.png"
    draw_views(
        views=out / "views",
        title="One scene, two reflectance models, four Suns near the horizon; exposed automatically",
        figure=sheet,
    )
    return count, sheet
