"""Mesh of the rover's body."""

from pathlib import Path

import numpy as np
from scipy import ndimage

from polarsim.geometry.poses import Pose
from polarsim.geometry.rays_embree import EmbreeCaster
from polarsim.rover.cameras.bodywork import body_of
from polarsim.rover.vehicle.table import read_vehicle

VIPER = Path(__file__).parents[3] / "config" / "viper.yaml"
STEP = 0.005  # m between rays
SLIT = 13  # rays across the widest detected slit, 6 cm


def test_no_light_falls_through_slits_between_the_bodys_parts():
    """A slit of 5 mm between body and solar panels produced a dotted line in the shadow under a Sun from behind."""
    body = body_of(read_vehicle(VIPER))
    still = [number for number, solid in enumerate(body.solids) if solid.link == "base_link"]
    vertices, _ = body.posed(dict.fromkeys(body.links, Pose.identity()))
    caster = EmbreeCaster(vertices, body.faces[np.isin(body.solid_of_face, still)])
    towards, aside, up = np.array([[1.0, 0.0, 0.14], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]])
    # Rays start behind the body in a plane, as from ground in grazing light.
    across, high = np.meshgrid(np.arange(-1, 1, STEP), np.arange(-0.2, 2.4, STEP))
    starts = across.reshape(-1, 1) * aside + high.reshape(-1, 1) * up - 2.0 * towards
    shadow = caster.occluded(starts, np.broadcast_to(towards, starts.shape), 10.0).reshape(across.shape)
    assert shadow.mean() > 0.1
    slits = ndimage.binary_closing(shadow, np.ones((SLIT, SLIT), bool)) & ~shadow
    assert not slits.any(), f"{slits.sum()} rays fall through slits"
