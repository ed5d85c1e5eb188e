"""Maps of a view: depth, normals, ids, photometric angles and shadows.

Files are 16-bit PNGs; depth is also written as TIFF with 32-bit floats.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from polarsim.formats import png
from polarsim.formats.files import write_bytes, writing, writing_folder
from polarsim.geometry.camera import Camera
from polarsim.geometry.vectors import normalise
from polarsim.photo import PhotoKey
from polarsim.render.hits import Hits, between_deg, cast_strip, for_strips
from polarsim.render.lamps import Lamp, lamps_on
from polarsim.render.lighting import visible_lamp_share
from polarsim.render.options import RenderOptions
from polarsim.render.shadows import SHADOW_BELOW, shading_of
from polarsim.render.surfaces import Surfaces

MM, CENTIDEGREES, SHARES = 1000.0, 100.0, 10_000.0
NO_VALUE = 0xFFFF  # file value of undefined pixels; larger values are clipped to NO_VALUE - 1
_ANGLES = ("emergence", "incidence", "phase")
_BY_LAMP = {"angles", "shading", "lit"}


@dataclass(frozen=True)
class LampMaps:
    """Maps (h, w) of a view under one lamp; NaN at pixels without surface.

    incidence_deg, phase_deg : float32
        Angles between normal and lamp, and between lamp and viewer.
    lit : float32
        Visible share of the lamp, 0 to 1; 0 if the surface faces away.
    shading : uint16
        LIT, or the occluder: codes of `render.shadows`; 0 at pixels without surface.
    """

    incidence_deg: np.ndarray
    phase_deg: np.ndarray
    lit: np.ndarray
    shading: np.ndarray


@dataclass(frozen=True)
class Maps:
    """Maps (h, w) of a view; pixels without surface are NaN, in `ids` 0.

    depth_m : float32
        Distance along the optical axis, metres.
    normal : (h, w, 3) float32
        Smooth unit normal towards the viewer, sandbox frame.
    emergence_deg : float32
        Angle between normal and viewer.
    ids : uint16
        BACKGROUND, GROUND, ROCK_IDS + k for rock k, as in instance maps.
    by_lamp : name -> LampMaps
        Maps of each lamp.
    """

    depth_m: np.ndarray
    normal: np.ndarray
    emergence_deg: np.ndarray
    ids: np.ndarray
    by_lamp: dict[str, LampMaps]


def compute_maps(
    surfaces: Surfaces,
    camera: Camera,
    lamps: Mapping[str, Lamp],
    options: RenderOptions,
    threads: int = 1,
) -> Maps:
    """Compute the maps with a ray through every pixel centre and rays from the hits to every lamp."""
    surfaces.prepare(shadows=bool(lamps))
    size = camera.lens.shape

    def empty() -> np.ndarray:
        return np.full(size, np.nan, np.float32)

    by_lamp = {name: LampMaps(empty(), empty(), empty(), np.zeros(size, np.uint16)) for name in lamps}
    maps = Maps(empty(), np.full((*size, 3), np.nan, np.float32), empty(), np.zeros(size, np.uint16), by_lamp)
    axis = camera.world_from_camera.rotation[:, 2]

    def work(rows: slice) -> None:
        hits = cast_strip(surfaces, camera, rows)

        def put(image: np.ndarray, values: np.ndarray) -> None:
            image[rows].reshape(-1, *image.shape[2:])[hits.pixel] = values

        put(maps.depth_m, (hits.point - camera.centre) @ axis)
        put(maps.normal, hits.normal)
        put(maps.emergence_deg, between_deg(hits.normal, hits.to_viewer))
        put(maps.ids, surfaces.id_of_face[hits.face])
        for name, lamp in lamps.items():
            for field, values in _lamp_values(surfaces, hits, lamp, options).items():
                put(getattr(by_lamp[name], field), values)

    for_strips(camera.lens.height, threads, work)
    return maps


def _lamp_values(surfaces: Surfaces, hits: Hits, lamp: Lamp, options: RenderOptions) -> dict[str, np.ndarray]:
    """Return the values of the fields of `LampMaps` at the hits."""
    to_lamp = normalise(lamp.light_at(hits.point, falloff=False)[0])
    share = visible_lamp_share(surfaces, hits, lamp, options.lamp_samples)
    return {
        "incidence_deg": between_deg(hits.normal, to_lamp),
        "phase_deg": between_deg(hits.to_viewer, to_lamp),
        "lit": share,
        "shading": shading_of(surfaces, hits, lamp, share < SHADOW_BELOW, options.lamp_samples),
    }


def write_maps(folder: Path, maps: Maps) -> None:
    """Write the maps as 16-bit PNGs.

    depth.png in mm, {incidence,emergence,phase}.png in 0.01 degrees, lit.png in 0.0001; undefined pixels are 65535.
    normal.png: x, y, z in red, green, blue, (n + 1) / 2 of 65535; undefined pixels are black. Also ids.png and
    shading.png. Maps that depend on light are written for the first lamp, if there is a lamp.
    """
    with writing_folder(folder) as out:
        png.write_png(out / "ids.png", maps.ids)
        for name in ("depth", "normal", "emergence"):
            png.write_png(out / f"{name}.png", _of_view(maps, name))
        for lamp in list(maps.by_lamp.values())[:1]:
            for name in ("incidence", "phase", "lit", "shading"):
                png.write_png(out / f"{name}.png", _of_lamp(lamp, name))


def lamps_for_maps(names: Collection[str], shadow_lamps: Collection[str]) -> list[str]:
    """Return the sorted names of the lamps for which maps are computed; empty if no selected map depends on light."""
    return sorted(shadow_lamps) if _BY_LAMP & set(names) else []


def write_view_maps(folder: Path, keys: Sequence[PhotoKey], maps: Maps, names: Collection[str]) -> None:
    """Write the selected maps (`RenderOptions.maps`) of one view, each kind into a separate folder.

    Maps of a view are named `TT_P_C.png`. Maps that depend on light are named `TT_P_light_az_C.png`, one per exposure
    bracket, for the lamp that casts the labelled shadows; exposure brackets without lamp have no such maps.
    """
    selected = {single for name in names for single in (_ANGLES if name == "angles" else (name,))}
    brackets = {str(key).rpartition("_")[0]: lamps_on(key)[0] for key in keys if lamps_on(key)}
    for key in keys[:1]:
        view = f"{key.terrain:02d}_{key.position}_{key.camera}"
        if "depth_float" in selected:
            _write_floats(folder / "depth_float" / f"{view}.tif", maps.depth_m)
        for name in sorted(selected & {"depth", "normal", "emergence"}):
            png.write_png(folder / name / f"{view}.png", _of_view(maps, name))
    for name in sorted(selected & {"incidence", "phase", "lit", "shading"}):
        content = {lamp: png.encode_png(_of_lamp(maps.by_lamp[lamp], name)) for lamp in set(brackets.values())}
        for bracket, lamp in brackets.items():
            write_bytes(folder / name / f"{bracket}.png", content[lamp])


def _write_floats(path: Path, values: np.ndarray) -> None:
    """Write values (h, w) as an uncompressed float32 TIFF, including NaN."""
    import tifffile

    with writing(path) as temporary:
        tifffile.imwrite(
            temporary, np.asarray(values, np.float32), photometric="minisblack", metadata=None, software=False
        )


def _of_view(maps: Maps, name: str) -> np.ndarray:
    """Return a map of a view in the units of the PNG file."""
    if name == "normal":
        return np.nan_to_num((maps.normal + 1) / 2 * NO_VALUE + 0.5).astype(np.uint16)
    return _scaled(maps.depth_m, MM) if name == "depth" else _scaled(maps.emergence_deg, CENTIDEGREES)


def _of_lamp(maps: LampMaps, name: str) -> np.ndarray:
    if name == "shading":
        return maps.shading
    return _scaled(maps.lit, SHARES) if name == "lit" else _scaled(getattr(maps, f"{name}_deg"), CENTIDEGREES)


def _scaled(values: np.ndarray, factor: float) -> np.ndarray:
    steps = np.minimum(np.nan_to_num(values * factor, nan=0.0) + 0.5, NO_VALUE - 1)
    return np.where(np.isnan(values), NO_VALUE, steps).astype(np.uint16)
