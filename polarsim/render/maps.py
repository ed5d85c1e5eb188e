"""Maps of a view: depth, normals, ids, photometric angles and shadows.

Files are 16-bit PNGs; depth is also written as TIFF with 32-bit floats.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from polarsim.formats import png
from polarsim.formats.files import write_bytes, writing, writing_folder
from polarsim.geometry.camera import Camera
from polarsim.geometry.vectors import normalise
from polarsim.photo import PhotoKey, terrain_text
from polarsim.render.hits import between_deg, cast_strip, for_strips
from polarsim.render.lamps import Lamp, lamps_on
from polarsim.render.lighting import visible_lamp_share
from polarsim.render.options import RenderOptions
from polarsim.render.shadows import SHADOW_BELOW, shading_of
from polarsim.render.surfaces import Surfaces

NO_VALUE = 0xFFFF  # file value of undefined pixels; larger values are clipped to NO_VALUE - 1
# Field of each scaled map and file value of one unit: metres to mm, degrees to 0.01 degrees, shares to 0.0001.
_SCALED = {
    "depth": ("depth_m", 1000.0),
    "emergence": ("emergence_deg", 100.0),
    "incidence": ("incidence_deg", 100.0),
    "phase": ("phase_deg", 100.0),
    "lit": ("lit", 10_000.0),
}
_OF_VIEW, _OF_LAMP = ("depth", "emergence", "normal"), ("incidence", "lit", "phase", "shading")


@dataclass(frozen=True)
class LampMaps:
    """Maps (h, w) of a view under one lamp; NaN at pixels without surface."""

    incidence_deg: np.ndarray  # float32, angle between normal and lamp
    phase_deg: np.ndarray  # float32, angle between lamp and viewer
    lit: np.ndarray  # float32, visible share of the lamp, 0 to 1; 0 if the surface faces away
    shading: np.ndarray  # uint16, LIT or the occluder: codes of `render.shadows`; 0 at pixels without surface


@dataclass(frozen=True)
class Maps:
    """Maps (h, w) of a view; pixels without surface are NaN, in `ids` 0."""

    depth_m: np.ndarray  # float32, distance along the optical axis
    normal: np.ndarray  # (h, w, 3) float32, smooth unit normal towards the viewer, sandbox frame
    emergence_deg: np.ndarray  # float32, angle between normal and viewer
    ids: np.ndarray  # uint16: BACKGROUND, GROUND, ROCK_IDS + k for rock k, as in instance maps
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
            to_lamp = normalise(lamp.light_at(hits.point, falloff=False)[0])
            share = visible_lamp_share(surfaces, hits, lamp, options.lamp_samples)
            put(by_lamp[name].incidence_deg, between_deg(hits.normal, to_lamp))
            put(by_lamp[name].phase_deg, between_deg(hits.to_viewer, to_lamp))
            put(by_lamp[name].lit, share)
            put(by_lamp[name].shading, shading_of(surfaces, hits, lamp, share < SHADOW_BELOW, options.lamp_samples))

    for_strips(camera.lens.height, threads, work)
    return maps


def write_maps(folder: Path, maps: Maps) -> None:
    """Write the maps as 16-bit PNGs.

    depth.png in mm, {incidence,emergence,phase}.png in 0.01 degrees, lit.png in 0.0001; undefined pixels are 65535.
    normal.png: x, y, z in red, green, blue, (n + 1) / 2 of 65535; undefined pixels are black. Also ids.png and
    shading.png. Maps that depend on light are written for the first lamp, if there is a lamp.
    """
    with writing_folder(folder) as out:
        png.write_png(out / "ids.png", maps.ids)
        for name in _OF_VIEW:
            png.write_png(out / f"{name}.png", _file_values(maps, name))
        for lamp in list(maps.by_lamp.values())[:1]:
            for name in _OF_LAMP:
                png.write_png(out / f"{name}.png", _file_values(lamp, name))


def write_view_maps(
    folder: Path,
    keys: Sequence[PhotoKey],
    surfaces: Surfaces,
    camera: Camera,
    lamps: Mapping[str, Lamp],
    options: RenderOptions,
    threads: int = 1,
) -> None:
    """Compute the maps of one view that `options.maps` selects, and write each kind into a separate folder.

    Maps of a view are named `TT_P_C.png`. Maps that depend on light are named `TT_P_light_az_C.png`, one per exposure
    bracket, for the lamp that casts the labelled shadows; exposure brackets without lamp have no such maps.
    """
    if not keys or not options.maps:
        return
    angles = ("emergence", "incidence", "phase")
    selected = {single for name in options.maps for single in (angles if name == "angles" else (name,))}
    brackets = {str(key).rpartition("_")[0]: lamps_on(key)[0] for key in keys if lamps_on(key)}
    needed = sorted(set(brackets.values())) if selected & set(_OF_LAMP) else []
    maps = compute_maps(surfaces, camera, {name: lamps[name] for name in needed}, options, threads)
    view = f"{terrain_text(keys[0].terrain)}_{keys[0].position}_{keys[0].camera}"
    if "depth_float" in selected:
        _write_floats(folder / "depth_float" / f"{view}.tif", maps.depth_m)
    for name in sorted(selected & set(_OF_VIEW)):
        png.write_png(folder / name / f"{view}.png", _file_values(maps, name))
    for name in sorted(selected & set(_OF_LAMP)):
        content = {lamp: png.encode_png(_file_values(maps.by_lamp[lamp], name)) for lamp in needed}
        for bracket, lamp in brackets.items():
            write_bytes(folder / name / f"{bracket}.png", content[lamp])


def _write_floats(path: Path, values: np.ndarray) -> None:
    """Write values (h, w) as an uncompressed float32 TIFF, including NaN."""
    import tifffile

    with writing(path) as temporary:
        tifffile.imwrite(
            temporary, np.asarray(values, np.float32), photometric="minisblack", metadata=None, software=False
        )


def _file_values(maps: Maps | LampMaps, name: str) -> np.ndarray:
    """Return a map in the units of the PNG file, uint16."""
    if name == "normal":
        return np.nan_to_num((getattr(maps, name) + 1) / 2 * NO_VALUE + 0.5).astype(np.uint16)
    if name == "shading":
        return np.asarray(getattr(maps, name))
    field, factor = _SCALED[name]
    values = getattr(maps, field)
    steps = np.minimum(np.nan_to_num(values * factor, nan=0.0) + 0.5, NO_VALUE - 1)
    return np.where(np.isnan(values), NO_VALUE, steps).astype(np.uint16)
