"""Maps in files: 16-bit PNGs of depth, normals, angles and shadows, depth also as 32-bit floats."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from pathlib import Path

import numpy as np

from polarsim.formats import png, tiff
from polarsim.formats.files import write_bytes, writing_folder
from polarsim.photo import PhotoKey
from polarsim.render.lamps import lit_by
from polarsim.render.maps import LampMaps, Maps

MM, CENTIDEGREES, SHARES = 1000.0, 100.0, 10_000.0
MOST = 0xFFFF  # in the files: what no pixel has; depths beyond are cut to one less
_ANGLES = ("emergence", "incidence", "phase")
_BY_LAMP = {"angles", "shading", "lit"}


def write_maps(folder: Path, maps: Maps) -> None:
    """Write 16-bit PNGs: depth.png in mm, {incidence,emergence,phase}.png in 0.01 degrees, lit.png in 0.0001, 65535
    where nothing is; normal.png, red to blue x to z, (n + 1) / 2 of 65535, black where nothing is; ids.png;
    shading.png. What depends on light is that of the first lamp; without any it is not written.
    """
    with writing_folder(folder) as out:
        png.write(out / "ids.png", maps.ids)
        for name in ("depth", "normal", "emergence"):
            png.write(out / f"{name}.png", _of_view(maps, name))
        for lamp in list(maps.by_lamp.values())[:1]:
            for name in ("incidence", "phase", "lit", "shading"):
                png.write(out / f"{name}.png", _of_lamp(lamp, name))


def lamps_of_maps(names: Collection[str], shadow_lamps: Collection[str]) -> list[str]:
    """Names of the lamps that maps are needed of, of those that throw labelled shadows."""
    return sorted(shadow_lamps) if _BY_LAMP & set(names) else []


def write_view_maps(folder: Path, keys: Sequence[PhotoKey], maps: Maps, names: Collection[str]) -> None:
    """Write the maps of one view that are asked for, `RenderOptions.maps`, each kind into a folder of its own.

    `TT_P_C.png` is of a view, `TT_P_light_az_C.png` of an exposure bracket: under the lamp that throws its labelled
    shadows; exposure brackets without any lamp have none.
    """
    asked = {single for name in names for single in (_ANGLES if name == "angles" else (name,))}
    brackets = {str(key).rpartition("_")[0]: lit_by(key)[0] for key in keys if lit_by(key)}
    for key in keys[:1]:
        view = f"{key.terrain:02d}_{key.position}_{key.camera}"
        if "depth_float" in asked:
            tiff.write_floats(folder / "depth_float" / f"{view}.tif", maps.depth_m)
        for name in sorted(asked & {"depth", "normal", "emergence"}):
            png.write(folder / name / f"{view}.png", _of_view(maps, name))
    for name in sorted(asked & {"incidence", "phase", "lit", "shading"}):
        content = {lamp: png.encode(_of_lamp(maps.by_lamp[lamp], name)) for lamp in set(brackets.values())}
        for bracket, lamp in brackets.items():
            write_bytes(folder / name / f"{bracket}.png", content[lamp])


def _of_view(maps: Maps, name: str) -> np.ndarray:
    """A picture of a view as its PNG has it."""
    if name == "normal":
        return np.nan_to_num((maps.normal + 1) / 2 * MOST + 0.5).astype(np.uint16)
    return _scaled(maps.depth_m, MM) if name == "depth" else _scaled(maps.emergence_deg, CENTIDEGREES)


def _of_lamp(maps: LampMaps, name: str) -> np.ndarray:
    if name == "shading":
        return maps.shading
    return _scaled(maps.lit, SHARES) if name == "lit" else _scaled(getattr(maps, f"{name}_deg"), CENTIDEGREES)


def _scaled(values: np.ndarray, factor: float) -> np.ndarray:
    steps = np.minimum(np.nan_to_num(values * factor, nan=0.0) + 0.5, MOST - 1)
    return np.where(np.isnan(values), MOST, steps).astype(np.uint16)
