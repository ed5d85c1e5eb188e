"""What a folder of novel views holds: its pictures, their labels as COCO, its rocks, YOLO's data.yaml."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pandas as pd

from polarsim.formats import coco, tables
from polarsim.formats.files import write_text
from polarsim.geometry.poses import yaw_pitch_roll
from polarsim.photo import BOX_CLASSES, ROCK, SHADOW
from polarsim.render.views.plan import Picture
from polarsim.render.views.scenes import Ensemble

Entry = tuple[Picture, float, list[coco.Annotation]]  # a picture, its exposure in ms, its labels


def write_listing(out: Path, entries: Sequence[Entry]) -> None:
    """Write index.csv, annotations.json, rocks.csv and data.yaml."""
    tables.write_csv(out / "index.csv", pd.DataFrame([_index_row(*entry) for entry in entries]))
    pictures = [
        (
            {
                "id": picture.number + 1,
                "file_name": f"{picture.name}.png",
                "width": picture.size[0],
                "height": picture.size[1],
                **picture.columns(),
                "exposure_ms": exposure_ms,
            },
            labels,
        )
        for picture, exposure_ms, labels in entries
    ]
    coco.write_pictures(out / "annotations.json", pictures, "Rocks and shadows of novel views, labelled by polarsim")
    scenes = {picture.scene.name: picture.scene for picture, _, _ in entries}
    tables.write_csv(out / "rocks.csv", _rocks(list(scenes.values())))
    names = "".join(f"  {number}: {name}\n" for number, name in enumerate(BOX_CLASSES))
    note = "# Paths are relative to this file. For validation divide by camera: pictures of one are alike."
    write_text(out / "data.yaml", f"{note}\ntrain: images\nval: images\nnames:\n{names}")


def _index_row(picture: Picture, exposure_ms: float, labels: list[coco.Annotation]) -> dict[str, object]:
    pose = picture.camera.world_from_camera
    angles = zip(("yaw_deg", "pitch_deg", "roll_deg"), np.degrees(yaw_pitch_roll(pose)).tolist(), strict=True)
    return {
        "name": picture.name,
        **picture.columns(),
        "exposure_ms": exposure_ms,
        **dict(zip(("x_m", "y_m", "z_m"), pose.translation.tolist(), strict=True)),
        **dict(angles),
        "azimuth_deg": picture.light.azimuth_deg,
        "elevation_deg": picture.light.elevation_deg,
        "moment_utc": picture.light.moment_utc,
        "instances": f"{picture.ground_truth}.png",
        "rocks": sum(label.kind == ROCK for label in labels),
        "shadows": sum(label.kind == SHADOW for label in labels),
    }


def _rocks(scenes: Sequence[Ensemble]) -> pd.DataFrame:
    """Every rock of every scene, and the terrain and id that it has in its meshes."""
    rows = [
        {
            "scene": scene.name,
            "rock": rock,
            "terrain": scene.parts[place].section.terrain,
            "terrain_rock": own,
            "meshes": str(scene.parts[place].section.meshes),
        }
        for scene in scenes
        for rock, (place, own) in scene.rocks.items()
    ]
    return pd.DataFrame(rows, columns=["scene", "rock", "terrain", "terrain_rock", "meshes"])
