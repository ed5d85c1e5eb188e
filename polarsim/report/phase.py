"""Phase angles: between the ways to the lamp and to the camera, seen from the ground that a photo shows.

Where they are near 0 a surface hides its own shadows and is at its brightest: the opposition effect.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from polarsim.formats.lamps import read_suns
from polarsim.formats.rigs import PlacedRig, read_all_placed
from polarsim.geometry.lens import HALF_PIXEL
from polarsim.geometry.poses import Pose
from polarsim.photo import PhotoKey
from polarsim.survey import SANDBOX_HALF_WIDTH

STEP_PX = 16  # between the pixels that are asked
WALL_MARGIN = 0.8  # metres of sand before the walls that are not asked: crops shall show ground


@dataclass(frozen=True)
class Place:
    """A pixel of a photo, and the phase angle of the ground there."""

    key: PhotoKey
    u: float
    v: float
    phase_deg: float


def lit_by_one_lamp(key: PhotoKey) -> bool:
    """Whether a Sun lamp or the rover light is on, and not both: only then a place has one phase angle."""
    return (key.azimuth != "no") != (key.light == "on")


def extreme_places(keys: list[PhotoKey], cameras: Path, half_px: int) -> tuple[Place, Place] | None:
    """The places of the smallest and of the largest phase angle in photos that one lamp lights; None without any.

    Parameters
    ----------
    keys
        Of one terrain.
    cameras
        Folder of its rig poses and lamps.
    half_px
        A window of this reach around the place lies in the photo.
    """
    rigs = read_all_placed(cameras)
    lamps = read_suns(cameras, rigs)
    found: dict[tuple[object, ...], tuple[Place, Place]] = {}
    for key in sorted(keys):
        if key.position not in rigs or not lit_by_one_lamp(key) or key.bracket in found:
            continue
        rig = rigs[key.position]
        lamp = lamps.get(key.azimuth) if key.light == "off" else rig.rover_light
        angles = None if lamp is None else _angles(rig, key, lamp, half_px)
        if angles is not None:
            found[key.bracket] = angles
    if not found:
        return None
    nearest = min((near for near, _ in found.values()), key=lambda place: (place.phase_deg, place.key))
    farthest = max((far for _, far in found.values()), key=lambda place: (place.phase_deg, place.key))
    return nearest, farthest


def phase_angles(sandbox_from_camera: Pose, directions: np.ndarray, lamp_sandbox: np.ndarray) -> np.ndarray:
    """(...) phase angle in radians where directions (..., 3) of a camera meet the plane z = 0.

    NaN near the walls and outside them.
    """
    rays = sandbox_from_camera.rotate(directions)
    eye = sandbox_from_camera.translation
    with np.errstate(divide="ignore", invalid="ignore"):
        distance = np.where(rays[..., 2] < 0, -eye[2] / rays[..., 2], np.nan)
    ground = eye + distance[..., None] * rays
    inside = (np.abs(ground[..., :2]) <= SANDBOX_HALF_WIDTH - WALL_MARGIN).all(axis=-1)
    to_eye, to_lamp = eye - ground, lamp_sandbox - ground
    sine = np.linalg.norm(np.cross(to_eye, to_lamp), axis=-1)
    return np.where(inside, np.arctan2(sine, (to_eye * to_lamp).sum(axis=-1)), np.nan)


def _angles(rig: PlacedRig, key: PhotoKey, lamp: np.ndarray, half_px: int) -> tuple[Place, Place] | None:
    lens = rig.rig.lens(key.camera)
    u = np.arange(half_px, lens.width - half_px, STEP_PX) + HALF_PIXEL
    v = np.arange(half_px, lens.height - half_px, STEP_PX) + HALF_PIXEL
    pixels = np.stack(np.meshgrid(u, v), axis=-1).reshape(-1, 2)
    angles = np.degrees(phase_angles(rig.sandbox_from(key.camera), lens.directions(pixels), lamp))
    if np.isnan(angles).all():
        return None
    near, far = (
        Place(key, float(pixels[at, 0]), float(pixels[at, 1]), float(angles[at]))
        for at in (np.nanargmin(angles), np.nanargmax(angles))
    )
    return near, far
