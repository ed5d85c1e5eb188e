"""What the pixels of a view show besides light: depth, normals, ids, the angles that reflectance goes by, shadows."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from polarsim.geometry.camera import Camera
from polarsim.geometry.vectors import unit
from polarsim.render.hits import Hits, between_deg, cast_strip, for_strips
from polarsim.render.lamps import Lamp
from polarsim.render.lighting import lit_share
from polarsim.render.options import RenderOptions
from polarsim.render.shading import shading_of
from polarsim.render.surfaces import Surfaces


@dataclass(frozen=True)
class LampMaps:
    """Pictures (h, w) of a view under one lamp; NaN where it shows nothing.

    incidence_deg, phase_deg : float32
        Between normal and lamp, lamp and viewer.
    lit : float32
        Share of the lamp that the surface sees, 0 to 1; 0 where it faces away.
    shading : uint16
        LIT, or what keeps the lamp away: codes of `formats.shading`, 0 where it shows nothing.
    """

    incidence_deg: np.ndarray
    phase_deg: np.ndarray
    lit: np.ndarray
    shading: np.ndarray


@dataclass(frozen=True)
class Maps:
    """Pictures (h, w) of a view; where it shows nothing they are NaN, ids 0.

    depth_m : float32
        Along the optical axis, metres.
    normal : (h, w, 3) float32
        Unit, smooth, towards the viewer, sandbox frame.
    emergence_deg : float32
        Between normal and viewer.
    ids : uint16
        BACKGROUND, GROUND, ROCK_IDS + k for rock k, as in instance maps.
    by_lamp : name -> LampMaps
        What depends on light.
    """

    depth_m: np.ndarray
    normal: np.ndarray
    emergence_deg: np.ndarray
    ids: np.ndarray
    by_lamp: dict[str, LampMaps]


def maps_of(
    surfaces: Surfaces,
    camera: Camera,
    lamps: Mapping[str, Lamp],
    options: RenderOptions,
    threads: int = 1,
) -> Maps:
    """Cast a ray through every pixel's centre, and from there rays to every lamp."""
    surfaces.prepare(shadows=bool(lamps))
    size = camera.lens.shape

    def empty() -> np.ndarray:
        return np.full(size, np.nan, np.float32)

    by_lamp = {name: LampMaps(empty(), empty(), empty(), np.zeros(size, np.uint16)) for name in lamps}
    maps = Maps(empty(), np.full((*size, 3), np.nan, np.float32), empty(), np.zeros(size, np.uint16), by_lamp)
    axis = camera.world_from_camera.rotation[:, 2]

    def work(rows: slice) -> None:
        hits = cast_strip(surfaces, camera, rows)

        def put(picture: np.ndarray, values: np.ndarray) -> None:
            picture[rows].reshape(-1, *picture.shape[2:])[hits.pixel] = values

        put(maps.depth_m, (hits.point - camera.centre) @ axis)
        put(maps.normal, hits.normal)
        put(maps.emergence_deg, between_deg(hits.normal, hits.to_viewer))
        put(maps.ids, surfaces.id_of_face[hits.face])
        for name, lamp in lamps.items():
            under = _under(surfaces, hits, lamp, options)
            for field, values in under.items():
                put(getattr(by_lamp[name], field), values)

    for_strips(camera.lens.height, threads, work)
    return maps


def _under(surfaces: Surfaces, hits: Hits, lamp: Lamp, options: RenderOptions) -> dict[str, np.ndarray]:
    """The fields of `LampMaps` at the hits."""
    to_lamp = unit(lamp.light_at(hits.point, falloff=False)[0])
    share = lit_share(surfaces, hits, lamp, options.lamp_samples)
    return {
        "incidence_deg": between_deg(hits.normal, to_lamp),
        "phase_deg": between_deg(hits.to_viewer, to_lamp),
        "lit": share,
        "shading": shading_of(surfaces, hits, lamp, share < options.shadow_below, options.lamp_samples),
    }
