"""The tables of a catalogue: pictures, labels, poses, lenses, lamps, rocks; units in names, origins beside values."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
import pandas as pd

from polarsim.formats import png
from polarsim.formats.tables import key_columns
from polarsim.geometry.poses import Pose
from polarsim.photo import CAMERAS, NO_ROCK, ROCK
from polarsim.publish.bundle import Bundle
from polarsim.publish.catalogue import MAPS, Catalogue, Picture, shadow_casters
from polarsim.run_files.instances import ROCK_IDS, SHADOW_IDS

PICTURE_FILE, MAP_FILE = "pictures/{name}.png", "maps/{name}/{stem}.png"
# Meaning and unit of every column, for people and for labels that state them; empty: a name, count or share.
COLUMNS: dict[str, tuple[str, str]] = {
    "picture": ("Domain and key of the picture.", ""),
    "file": ("Path in this bundle: 16-bit PNG, of pictures with 12-bit values.", ""),
    "domain": ("real, analog, or the reflectance model of a twin.", ""),
    "key": ("Photo key: terrain, position, light, azimuth, camera, exposure.", ""),
    "terrain": ("Number of the sandbox scene, 1 to 13.", ""),
    "position": ("Place of the tripod.", ""),
    "light": ("Rover light, on or off.", ""),
    "azimuth": ("Azimuth of the Sun lamp in the sandbox frame; no: the lamp is off.", ""),
    "camera": ("L or R of the stereo rig.", ""),
    "exposure_ms": ("Exposure time.", "ms"),
    "width": ("Width of the picture.", "px"),
    "height": ("Height of the picture.", "px"),
    "sha256": ("SHA-256 of the picture's file.", ""),
    "part": ("Part of the split: train, val, test; empty where none was drawn.", ""),
    "origin": ("Where the row's values come from: measured, fitted or synthetic.", ""),
    "label": ("Number of the label on its picture, from 0.", ""),
    "kind": ("rock or shadow.", ""),
    "rock": ("Number of the rock in its terrain, the same in all tables and meshes; -1: not known.", ""),
    "shadow_of": ("Of a shadow the number of the label that throws it, on the same picture; -1: none.", ""),
    "source": ("seed: a person drew it; fused, translated, projected, cast: propagated; rendered: exact.", ""),
    "confidence": ("Confidence of the label, 0 to 1.", ""),
    "x0": ("Left edge of the box, from the picture's left border.", "px"),
    "y0": ("Upper edge of the box, from the picture's upper border.", "px"),
    "x1": ("Right edge of the box.", "px"),
    "y1": ("Lower edge of the box.", "px"),
    "area_px": ("Pixels of the visible mask; of the box where there is no mask.", "px2"),
    "mask_rle": ("Visible mask as compressed COCO runs of the whole picture; empty: none.", ""),
    "amodal_rle": ("Mask with what others hide, as runs; empty: not known.", ""),
    "visible_share": ("Visible over amodal area.", ""),
    "x_m": ("Place in the sandbox frame along X, to Sun azimuth 0.", "m"),
    "y_m": ("Place in the sandbox frame along Y, to Sun azimuth 90.", "m"),
    "z_m": ("Place in the sandbox frame along Z, up.", "m"),
    "qw": ("Rotation from the camera (x right, y down, z forward) to the sandbox, quaternion, real part.", ""),
    "qx": ("The same, x.", ""),
    "qy": ("The same, y.", ""),
    "qz": ("The same, z.", ""),
    "fx_px": ("Focal length along x.", "px"),
    "fy_px": ("Focal length along y.", "px"),
    "cx_px": ("Principal point, from the picture's left border: pixel centres at integer + 0.5.", "px"),
    "cy_px": ("Principal point, from the picture's upper border.", "px"),
    "k1": ("Radial distortion of Brown's model as OpenCV has it.", ""),
    "k2": ("Radial distortion.", ""),
    "p1": ("Tangential distortion.", ""),
    "p2": ("Tangential distortion.", ""),
    "k3": ("Radial distortion.", ""),
    "method": ("What the pose rests on.", ""),
    "sd_mm": ("Formal standard deviation of the position; NaN where the fit states none.", "mm"),
    "sd_deg": ("Formal standard deviation of the direction; NaN where the fit states none.", "deg"),
    "lamp": ("Azimuth of a Sun lamp, or rover_ and the position whose rig carries the light.", ""),
    "mesh": ("File of the rock's mesh in the run.", ""),
    "made_from": ("scan, published, or fitted.", ""),
    "size_m": ("Longest side of the rock.", "m"),
    "height_m": ("Height above the ground.", "m"),
    "volume_m3": ("Volume above the ground.", "m3"),
    "points": ("Scanned points on the rock.", ""),
    "map": ("depth, normal, incidence, emergence, phase, lit or shading.", ""),
    "shows": ("View (terrain, position, camera) or exposure bracket (light and azimuth too) that the map is of.", ""),
    "unit": ("Unit of a step of the map's values.", ""),
    "step": ("What a value of the map is times, to be in its unit.", ""),
    "meaning": ("What the map's values say.", ""),
    "visible_share_of_plan": ("Share of the rock's plan that some scan saw.", ""),
}


def quaternion(pose: Pose) -> dict[str, float]:
    """qw, qx, qy, qz of a pose's rotation; qw is not below 0."""
    from scipy.spatial.transform import Rotation

    x, y, z, w = (float(value) for value in Rotation.from_matrix(pose.rotation).as_quat(canonical=True))
    return {"qw": w, "qx": x, "qy": y, "qz": z}


def pictures(catalogue: Catalogue, bundle: Bundle | None = None) -> pd.DataFrame:
    """A row a picture; checksums of the bundle's files where they were copied into one."""
    rows = []
    for one in catalogue.pictures:
        file = PICTURE_FILE.format(name=one.name)
        rows.append(
            {
                "picture": one.name,
                "file": file,
                "domain": one.domain,
                **key_columns(one.key),
                "width": one.width,
                "height": one.height,
                "sha256": bundle.sha256(file) if bundle else one.sha256,
                "part": one.part,
                "origin": catalogue.picture_origin(one),
            }
        )
    return pd.DataFrame(rows)


def labels(catalogue: Catalogue) -> pd.DataFrame:
    """A row a label of every picture."""
    rows = [row for one in catalogue.pictures for row in label_rows(catalogue, one)]
    columns = [
        "picture", "label", "kind", "rock", "shadow_of", "source", "confidence", "x0", "y0", "x1", "y1", "area_px",
        "mask_rle", "amodal_rle", "visible_share", "origin",
    ]  # fmt: skip
    return pd.DataFrame(rows, columns=columns)


def label_rows(catalogue: Catalogue, picture: Picture) -> Iterator[dict[str, Any]]:
    """Of one picture, in the order of its labels."""
    own = catalogue.labels(picture)
    for index, (one, caster) in enumerate(zip(own, shadow_casters(own), strict=True)):
        x0, y0, x1, y1 = (round(float(edge), 3) for edge in one.box)
        yield {
            "picture": picture.name,
            "label": index,
            "kind": one.kind,
            "rock": one.rock,
            "shadow_of": caster,
            "source": one.source,
            "confidence": float(one.confidence),
            "x0": x0,
            "y0": y0,
            "x1": x1,
            "y1": y1,
            "area_px": float(one.mask.area if one.mask else round((x1 - x0) * (y1 - y0), 3)),
            "mask_rle": one.mask.counts if one.mask else "",
            "amodal_rle": one.amodal.mask.counts if one.amodal else "",
            "visible_share": round(one.visible_share, 4),
            "origin": catalogue.label_origin(one),
        }


def poses(catalogue: Catalogue) -> pd.DataFrame:
    """A row a camera of every localised position: its pose and its lens."""
    rows: list[dict[str, object]] = []
    for terrain in catalogue.terrains.values():
        for position, localised in sorted(terrain.rigs.items()):
            for side in CAMERAS:
                pose, lens = localised.sandbox_from(side), localised.rig.lens(side)
                rows.append(
                    {
                        "terrain": terrain.number,
                        "position": position,
                        "camera": side,
                        **dict(zip(("x_m", "y_m", "z_m"), map(float, pose.translation), strict=True)),
                        **quaternion(pose),
                        "fx_px": lens.fx,
                        "fy_px": lens.fy,
                        "cx_px": lens.cx,
                        "cy_px": lens.cy,
                        **dict(zip(("k1", "k2", "p1", "p2", "k3"), lens.distortion, strict=True)),
                        "width": lens.width,
                        "height": lens.height,
                        "method": localised.method,
                        "sd_mm": float(localised.metrics.get("sd_mm", np.nan)),
                        "sd_deg": float(localised.metrics.get("sd_deg", np.nan)),
                        "origin": terrain.pose_origin(position),
                    }
                )
    return pd.DataFrame(rows)


def lamps(catalogue: Catalogue) -> pd.DataFrame:
    """A row a Sun lamp of a terrain, and one a rover light of every localised position."""
    rows: list[dict[str, object]] = []
    for terrain in catalogue.terrains.values():
        named = [(name, position, terrain.sun_origin(name)) for name, position in terrain.suns.items()]
        named += [
            (f"rover_{position}", localised.rover_light, terrain.pose_origin(position))
            for position, localised in sorted(terrain.rigs.items())
        ]
        for name, position, origin in named:
            own = dict(zip(("x_m", "y_m", "z_m"), map(float, position), strict=True))
            rows.append({"terrain": terrain.number, "lamp": name, **own, "origin": origin})
    return pd.DataFrame(rows, columns=["terrain", "lamp", "x_m", "y_m", "z_m", "origin"])


def rocks(catalogue: Catalogue) -> pd.DataFrame:
    """A row a rock that has a mesh or was found in the scans."""
    rows: list[dict[str, object]] = []
    for terrain in catalogue.terrains.values():
        rows_of = [] if terrain.rocks is None else terrain.rocks.to_dict("records")
        found: dict[int, dict[Any, Any]] = {int(row["rock"]): row for row in rows_of}
        for rock in sorted({*found, *terrain.meshes} - {NO_ROCK}):
            own = found.get(rock, {})
            mesh = terrain.meshes.get(rock)
            made_from = terrain.made_from.get(mesh.name, "") if mesh else ""
            rows.append(
                {
                    "terrain": terrain.number,
                    "rock": rock,
                    **{f"{axis}_m": float(own.get(axis, np.nan)) for axis in "xyz"},
                    **{name: float(own.get(name, np.nan)) for name in ("size_m", "height_m", "volume_m3")},
                    "points": int(own.get("points", 0) or 0),
                    "visible_share_of_plan": float(own.get("visible_share", np.nan)),
                    "mesh": mesh.name if mesh else "",
                    "made_from": made_from,
                    "origin": "fitted",  # a surface laid through scanned points, or localised by labels
                }
            )
    columns = [
        "terrain", "rock", "x_m", "y_m", "z_m", "size_m", "height_m", "volume_m3", "points", "visible_share_of_plan",
        "mesh", "made_from", "origin",
    ]  # fmt: skip
    return pd.DataFrame(rows, columns=columns)


def all_tables(catalogue: Catalogue, bundle: Bundle | None = None) -> dict[str, pd.DataFrame]:
    """Every table by name, those with rows."""
    found = {
        "pictures": pictures(catalogue, bundle),
        "labels": labels(catalogue),
        "poses": poses(catalogue),
        "lamps": lamps(catalogue),
        "rocks": rocks(catalogue),
        "maps": maps(catalogue),
    }
    for name, table in found.items():
        unknown = set(table.columns) - set(COLUMNS)
        assert not unknown, (name, unknown)  # every column has a meaning
    return {name: table for name, table in found.items() if len(table)}


def copy_pictures(catalogue: Catalogue, bundle: Bundle) -> None:
    """The pictures as they are, 16 bits."""
    for one in catalogue.pictures:
        bundle.copy(PICTURE_FILE.format(name=one.name), one.path)


def ids(catalogue: Catalogue, picture: Picture) -> np.ndarray:
    """(h, w) uint16: the renderer's own map of a twin, else what `id_map` paints."""
    exact = catalogue.instances(picture)
    return png.read(exact) if exact else id_map(catalogue, picture)


def copy_maps(catalogue: Catalogue, bundle: Bundle) -> None:
    """`maps/<kind>/`, as the run has them."""
    for name, path in catalogue.maps():
        bundle.copy(MAP_FILE.format(name=name, stem=path.stem), path)


def maps(catalogue: Catalogue) -> pd.DataFrame:
    """A row a map."""
    rows = []
    for name, path in catalogue.maps():
        unit, step, meaning = MAPS[name]
        own = {"map": name, "shows": path.stem, "file": MAP_FILE.format(name=name, stem=path.stem)}
        rows.append(own | {"unit": unit, "step": step, "meaning": meaning, "origin": "fitted"})
    return pd.DataFrame(rows)


def id_map(catalogue: Catalogue, picture: Picture) -> np.ndarray:
    """(h, w) uint16 painted of the masks: rock k is 1000 + k, its shadow 2000 + k; see `UNKNOWN`.

    Shadows first and rocks over them, hidden rocks before those in front: of masks of what is to be seen none overlap
    but those of shadows.
    """
    painted = np.zeros((picture.height, picture.width), np.uint16)
    for one in sorted(catalogue.labels(picture), key=lambda one: one.kind == ROCK):
        if one.mask:
            start = ROCK_IDS if one.kind == ROCK else SHADOW_IDS
            painted[one.mask.mask()] = start + one.rock if one.rock != NO_ROCK else UNKNOWN[one.kind]
    return painted


UNKNOWN = {"rock": 65534, "shadow": 65535}  # in a map of ids: of a rock whose number is not known
