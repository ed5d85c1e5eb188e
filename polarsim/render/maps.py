"""What the pixels of a view show besides light: depth, normals, ids, and the angles that reflectance goes by."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from polarsim.formats import png
from polarsim.formats.files import writing_folder
from polarsim.geometry.lens import Lens
from polarsim.geometry.poses import Pose
from polarsim.geometry.vectors import unit
from polarsim.render.hits import between_deg, cast_strip, for_strips
from polarsim.render.lamps import Lamp
from polarsim.render.surfaces import Surfaces

MM, CENTIDEGREES = 1000.0, 100.0
MOST = 0xFFFF  # in the files: what no pixel has; depths beyond are cut to one less


@dataclass(frozen=True)
class Maps:
    """Pictures (h, w) of a view; where it shows nothing they are NaN, ids 0.

    depth_m : float32
        Along the optical axis, metres.
    normal : (h, w, 3) float32
        Unit, smooth, towards the viewer, sandbox frame.
    incidence_deg, emergence_deg, phase_deg : float32
        Between normal and lamp, normal and viewer, lamp and viewer; without a lamp the first and last are NaN.
    ids : uint16
        BACKGROUND, GROUND, ROCK_IDS + k for rock k, as in instance maps.
    """

    depth_m: np.ndarray
    normal: np.ndarray
    incidence_deg: np.ndarray
    emergence_deg: np.ndarray
    phase_deg: np.ndarray
    ids: np.ndarray


def maps_of(surfaces: Surfaces, sandbox_from_camera: Pose, lens: Lens, lamp: Lamp | None, threads: int = 1) -> Maps:
    """Cast a ray through every pixel's centre."""
    surfaces.prepare(shadows=False)
    size = (lens.height, lens.width)
    depth, incidence, emergence, phase = (np.full(size, np.nan, np.float32) for _ in range(4))
    normal, ids = np.full((*size, 3), np.nan, np.float32), np.zeros(size, np.uint16)
    axis = sandbox_from_camera.rotation[:, 2]

    def work(rows: slice) -> None:
        hits = cast_strip(surfaces, sandbox_from_camera, lens, rows)
        from_camera = hits.point - sandbox_from_camera.translation
        depth[rows].reshape(-1)[hits.pixel] = from_camera @ axis
        normal[rows].reshape(-1, 3)[hits.pixel] = hits.normal
        emergence[rows].reshape(-1)[hits.pixel] = between_deg(hits.normal, hits.to_viewer)
        ids[rows].reshape(-1)[hits.pixel] = surfaces.id_of_face[hits.face]
        if lamp is not None:
            to_lamp = unit(lamp.light_at(hits.point, falloff=False)[0])
            incidence[rows].reshape(-1)[hits.pixel] = between_deg(hits.normal, to_lamp)
            phase[rows].reshape(-1)[hits.pixel] = between_deg(hits.to_viewer, to_lamp)

    for_strips(lens.height, threads, work)
    return Maps(depth, normal, incidence, emergence, phase, ids)


def write_maps(folder: Path, maps: Maps) -> None:
    """Write 16-bit PNGs: depth.png in mm and {incidence,emergence,phase}.png in 0.01 degrees, 65535 where nothing is;
    normal.png, red to blue x to z, (n + 1) / 2 of 65535, black where nothing is; ids.png.
    """
    with writing_folder(folder) as out:
        png.write(out / "depth.png", _scaled(maps.depth_m, MM))
        for name in ("incidence", "emergence", "phase"):
            png.write(out / f"{name}.png", _scaled(getattr(maps, f"{name}_deg"), CENTIDEGREES))
        png.write(out / "normal.png", np.nan_to_num((maps.normal + 1) / 2 * MOST + 0.5).astype(np.uint16))
        png.write(out / "ids.png", maps.ids)


def _scaled(values: np.ndarray, factor: float) -> np.ndarray:
    steps = np.minimum(np.nan_to_num(values * factor, nan=0.0) + 0.5, MOST - 1)
    return np.where(np.isnan(values), MOST, steps).astype(np.uint16)
