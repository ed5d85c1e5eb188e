"""Tables of a catalogue: images, labels, poses, lenses, lamps, rocks, maps."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
import pandas as pd

from polarsim.formats import png
from polarsim.formats.tables import key_columns
from polarsim.geometry.boxes import area
from polarsim.geometry.poses import Pose
from polarsim.photo import NO_ROCK, ROCK
from polarsim.publish.bundle import Bundle
from polarsim.publish.catalogue import MAPS, Catalogue, CatalogueImage, shadow_casters
from polarsim.run_files.instances import ROCK_IDS, SHADOW_IDS
from polarsim.schemas.photos import BOX

PICTURE_FILE, MAP_FILE = "pictures/{name}.png", "maps/{name}/{stem}.png"
# Meaning and unit of every column; the unit is empty for names, counts and shares.
COLUMNS: dict[str, tuple[str, str]] = {
    "picture": ("Domain and key of the image.", ""),
    "file": ("Path in this bundle: 16-bit PNG, images with 12-bit values.", ""),
    "domain": ("real, analog, or the reflectance model of a twin.", ""),
    "key": ("Photo key: terrain, position, light, azimuth, camera, exposure.", ""),
    "terrain": ("Number or name of the sandbox scene.", ""),
    "position": ("Tripod position.", ""),
    "light": ("Rover light, on or off.", ""),
    "azimuth": ("Azimuth of the Sun lamp in the sandbox frame; no: lamp off.", ""),
    "camera": ("L or R of the stereo rig.", ""),
    "exposure_ms": ("Exposure time.", "ms"),
    "width": ("Width of the image.", "px"),
    "height": ("Height of the image.", "px"),
    "sha256": ("SHA-256 of the image file.", ""),
    "part": ("Part of the split: train, val, test; empty without a split.", ""),
    "origin": ("Origin of the row's values: measured, fitted or synthetic.", ""),
    "label": ("Index of the label in the image, from 0.", ""),
    "kind": ("rock or shadow.", ""),
    "rock": ("Id of the rock in the terrain, the same in all tables and meshes; -1: not known.", ""),
    "shadow_of": ("For a shadow, index of the label of the rock that casts it, in the same image; -1: none.", ""),
    "source": ("seed: human annotation; fused, translated, projected, cast: propagated; rendered: exact.", ""),
    "confidence": ("Confidence of the label, 0 to 1.", ""),
    "x0": ("Left edge of the box, from the left border of the image.", "px"),
    "y0": ("Upper edge of the box, from the upper border of the image.", "px"),
    "x1": ("Right edge of the box.", "px"),
    "y1": ("Lower edge of the box.", "px"),
    "area_px": ("Area of the visible mask, or of the box if there is no mask.", "px2"),
    "mask_rle": ("Visible mask of the full image as compressed COCO RLE; empty: none.", ""),
    "amodal_rle": ("Amodal mask (including occluded parts) as compressed COCO RLE; empty: not known.", ""),
    "visible_share": ("Visible area over amodal area.", ""),
    "x_m": ("Position in the sandbox frame along X, to Sun azimuth 0.", "m"),
    "y_m": ("Position in the sandbox frame along Y, to Sun azimuth 90.", "m"),
    "z_m": ("Position in the sandbox frame along Z, up.", "m"),
    "qw": ("Rotation from the camera (x right, y down, z forward) to the sandbox, quaternion, real part.", ""),
    "qx": ("Quaternion, x.", ""),
    "qy": ("Quaternion, y.", ""),
    "qz": ("Quaternion, z.", ""),
    "fx_px": ("Focal length along x.", "px"),
    "fy_px": ("Focal length along y.", "px"),
    "cx_px": ("Principal point, from the left border of the image; pixel centres at integer + 0.5.", "px"),
    "cy_px": ("Principal point, from the upper border of the image.", "px"),
    "k1": ("Radial distortion, Brown's model as in OpenCV.", ""),
    "k2": ("Radial distortion.", ""),
    "p1": ("Tangential distortion.", ""),
    "p2": ("Tangential distortion.", ""),
    "k3": ("Radial distortion.", ""),
    "method": ("Data that the pose is computed from.", ""),
    "sd_mm": ("Formal standard deviation of the position; NaN if not available.", "mm"),
    "sd_deg": ("Formal standard deviation of the direction; NaN if not available.", "deg"),
    "lamp": ("Azimuth of a Sun lamp, or rover_ and the tripod position for a rover light.", ""),
    "mesh": ("File of the rock's mesh in the run.", ""),
    "made_from": ("scan, published, fitted, or photos.", ""),
    "size_m": ("Longest side of the rock.", "m"),
    "height_m": ("Height above the ground.", "m"),
    "volume_m3": ("Volume above the ground.", "m3"),
    "points": ("Scanned points on the rock.", ""),
    "map": ("depth, normal, incidence, emergence, phase, lit or shading.", ""),
    "shows": ("View (terrain, position, camera) or exposure bracket (also light and azimuth) of the map.", ""),
    "unit": ("Unit of the map after multiplication by step.", ""),
    "step": ("Factor from values of the map to the unit.", ""),
    "meaning": ("Meaning of the map's values.", ""),
    "visible_share_of_plan": ("Share of the rock's plan view covered by scans.", ""),
}


def meaning_of(column: pd.Series) -> tuple[str, str]:
    """Return the meaning and the unit of a column."""
    if column.name == "terrain" and not pd.api.types.is_integer_dtype(column):
        return "Name of the sandbox scene.", ""
    return COLUMNS[str(column.name)]


def quaternion(pose: Pose) -> dict[str, float]:
    """Return qw, qx, qy, qz of the rotation of a pose, with qw >= 0."""
    from scipy.spatial.transform import Rotation

    x, y, z, w = (float(value) for value in Rotation.from_matrix(pose.rotation).as_quat(canonical=True))
    return {"qw": w, "qx": x, "qy": y, "qz": z}


def _position(position: np.ndarray) -> dict[str, float]:
    return dict(zip(("x_m", "y_m", "z_m"), map(float, position), strict=True))


def pictures(catalogue: Catalogue, bundle: Bundle | None = None) -> pd.DataFrame:
    """Return a row per image, with checksums of the files in the bundle, if given."""
    rows = []
    for picture in catalogue.pictures:
        file = PICTURE_FILE.format(name=picture.name)
        rows.append(
            {
                "picture": picture.name,
                "file": file,
                "domain": picture.domain,
                **key_columns(picture.key),
                "width": picture.width,
                "height": picture.height,
                "sha256": bundle.sha256(file) if bundle else picture.sha256,
                "part": picture.part,
                "origin": catalogue.picture_origin(picture),
            }
        )
    return pd.DataFrame(rows)


def labels(catalogue: Catalogue) -> pd.DataFrame:
    """Return a row per label of every image."""
    return pd.DataFrame([row for picture in catalogue.pictures for row in image_label_rows(catalogue, picture)])


def image_label_rows(catalogue: Catalogue, picture: CatalogueImage) -> Iterator[dict[str, Any]]:
    """Yield the rows of the labels of an image."""
    annotations = catalogue.labels(picture)
    for index, (label, caster) in enumerate(zip(annotations, shadow_casters(annotations), strict=True)):
        edges = dict(zip(BOX.each, (round(float(edge), 3) for edge in label.box), strict=True))
        yield {
            "picture": picture.name,
            "label": index,
            "kind": label.kind,
            "rock": label.rock,
            "shadow_of": caster,
            "source": label.source,
            "confidence": float(label.confidence),
            **edges,
            "area_px": float(label.mask.area if label.mask else round(float(area(np.array(list(edges.values())))), 3)),
            "mask_rle": label.mask.counts if label.mask else "",
            "amodal_rle": label.amodal.mask.counts if label.amodal else "",
            "visible_share": round(label.visible_share, 4),
            "origin": catalogue.label_origin(label),
        }


def poses(catalogue: Catalogue) -> pd.DataFrame:
    """Return a row per camera of every localised position: pose and lens."""
    rows: list[dict[str, object]] = []
    for terrain in catalogue.terrains.values():
        for position, localised in sorted(terrain.rigs.items()):
            for side in localised.rig.sides:
                pose, lens = localised.sandbox_from(side), localised.rig.lens(side)
                rows.append(
                    {
                        "terrain": terrain.number,
                        "position": position,
                        "camera": side,
                        **_position(pose.translation),
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
    """Return a row per Sun lamp of a terrain and per rover light of a localised position."""
    rows: list[dict[str, object]] = []
    for terrain in catalogue.terrains.values():
        named = [(name, position, terrain.sun_origin(name)) for name, position in terrain.suns.items()]
        named += [(f"rover_{position}", place, origin) for position, place, origin in terrain.rig_lamps]
        for name, position, origin in named:
            rows.append({"terrain": terrain.number, "lamp": name, **_position(position), "origin": origin})
    return pd.DataFrame(rows)


def rocks(catalogue: Catalogue) -> pd.DataFrame:
    """Return a row per rock that has a mesh or is listed in the run's rocks."""
    rows: list[dict[str, object]] = []
    for terrain in catalogue.terrains.values():
        rows_of = [] if terrain.rocks is None else terrain.rocks.to_dict("records")
        listed: dict[int, dict[Any, Any]] = {int(row["rock"]): row for row in rows_of}
        for rock in sorted({*listed, *terrain.meshes} - {NO_ROCK}):
            facts = listed.get(rock, {})
            mesh = terrain.meshes[rock].name if rock in terrain.meshes else ""
            rows.append(
                {
                    "terrain": terrain.number,
                    "rock": rock,
                    **{f"{axis}_m": float(facts.get(axis, np.nan)) for axis in "xyz"},
                    **{name: float(facts.get(name, np.nan)) for name in ("size_m", "height_m", "volume_m3")},
                    "points": int(facts.get("points", 0) or 0),
                    "visible_share_of_plan": float(facts.get("visible_share", np.nan)),
                    "mesh": mesh,
                    "made_from": terrain.made_from.get(mesh, ""),
                    "origin": "fitted",  # surface fitted to scan points, or located by labels
                }
            )
    return pd.DataFrame(rows)


def all_tables(catalogue: Catalogue, bundle: Bundle | None = None) -> dict[str, pd.DataFrame]:
    """Every table by name, those with rows."""
    tables = {"pictures": pictures(catalogue, bundle)}
    tables |= {make.__name__: make(catalogue) for make in (labels, poses, lamps, rocks, maps)}
    return {name: table for name, table in tables.items() if len(table)}


def copy_images(catalogue: Catalogue, bundle: Bundle) -> None:
    """Copy the 16-bit images and the maps."""
    for picture in catalogue.pictures:
        bundle.copy(PICTURE_FILE.format(name=picture.name), picture.path)
    for name, path in catalogue.maps():
        bundle.copy(MAP_FILE.format(name=name, stem=path.stem), path)


def ids(catalogue: Catalogue, picture: CatalogueImage) -> np.ndarray:
    """Return the instance map (h, w) uint16: rendered for twins, otherwise `id_map`."""
    exact = catalogue.instances(picture)
    return png.read_png(exact) if exact else id_map(catalogue, picture)


def encoded_ids(catalogue: Catalogue, picture: CatalogueImage) -> bytes:
    """Return the instance map as a PNG file."""
    exact = catalogue.instances(picture)
    return exact.read_bytes() if exact else png.encode_png(id_map(catalogue, picture))


def maps(catalogue: Catalogue) -> pd.DataFrame:
    """Return a row per map."""
    rows = []
    for name, path in catalogue.maps():
        unit, step, meaning = MAPS[name]
        file = {"map": name, "shows": path.stem, "file": MAP_FILE.format(name=name, stem=path.stem)}
        rows.append(file | {"unit": unit, "step": step, "meaning": meaning, "origin": "fitted"})
    return pd.DataFrame(rows)


def id_map(catalogue: Catalogue, picture: CatalogueImage) -> np.ndarray:
    """Return an instance map (h, w) uint16 from masks: 1000 + k for rock k, 2000 + k for its shadow, or `UNKNOWN`.

    Rocks overwrite shadows. Visible masks of rocks do not overlap; masks of shadows may overlap.
    """
    ids_of_pixels = np.zeros((picture.height, picture.width), np.uint16)
    for label in sorted(catalogue.labels(picture), key=lambda label: label.kind == ROCK):
        if label.mask:
            start = ROCK_IDS if label.kind == ROCK else SHADOW_IDS
            ids_of_pixels[label.mask.mask()] = start + label.rock if label.rock != NO_ROCK else UNKNOWN[label.kind]
    return ids_of_pixels


UNKNOWN = {"rock": 65534, "shadow": 65535}  # ids of rocks and shadows without rock id
