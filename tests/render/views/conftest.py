"""Novel views of the small terrain: a block on level ground."""

import numpy as np
import pytest

from polarsim.render.views.options import Views

SIZE = {"width_px": 96, "height_px": 64}


@pytest.fixture
def views_of(folders):
    """`views_of(**changes)`: views of the block with a single camera and Sun, 96 x 64 px."""

    def make(**changes):
        return Views.model_validate(
            {
                "scenes": [{"name": "one", "meshes": folders / "meshes", "terrain": 1}],
                "lens": {"kind": "pinhole", "hfov_deg": 60, **SIZE},
                "cameras": [{"kind": "point", "position_m": [1.5, 1.2, 0.9], "look_at_m": [0, 0, 0.1]}],
                "lights": [{"kind": "sun", "azimuth_deg": [120], "elevation_deg": [20]}],
                "exposures_ms": [64],
                "render": {"models": ["lambert"], "walls": False},
            }
            | changes
        )

    return make


@pytest.fixture
def tone():
    """Tone curve that returns the upper eight of twelve bits."""
    return lambda grey: np.repeat((grey >> 4).astype(np.uint8)[..., None], 3, axis=2)
