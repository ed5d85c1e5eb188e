"""A small run: one terrain, two rocks that occlude each other, shadows, two Suns, both cameras, one kind of twin."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd

from polarsim.formats import coco, obj, png, rle
from polarsim.formats.coco_annotations import Amodal, Annotation
from polarsim.formats.tables import PHOTO_COLUMNS, key_columns, write_csv, write_parquet
from polarsim.geometry.boxes import box_of_mask
from polarsim.geometry.meshes import Mesh
from polarsim.geometry.poses import camera_pose
from polarsim.geometry.stereo import StereoRig
from polarsim.photo import NO_ROCK, ROCK, SHADOW, PhotoKey
from polarsim.run_files import lamps, rigs
from polarsim.run_files.inventory import Inventory, write_inventory
from polarsim.run_files.walls import level_walls, write_walls
from polarsim.schemas.stages import ROCKS
from polarsim.site import polar
from tests.support.polar_rig import default_rig

SIZE = (484, 304)  # a quarter of the rig's
KEYS = [PhotoKey.parse(f"01_A_off_{azimuth}_{camera}_0256") for azimuth in ("180", "30") for camera in "LR"]
PARTS = {key: "test" if key.azimuth == "30" else "train" for key in KEYS}
ROCK_PLACES = {4: (0.2, 0.1, 0.1), 7: (-0.3, -0.2, 0.08)}  # centre and radius by number, metres
SUN_180 = np.array([-3.5, 0.4, 0.8])


def small_rig() -> StereoRig:
    rig = default_rig()
    return StereoRig(rig.left.scaled(0.25), rig.right.scaled(0.25), rig.left_from_right)


def rock_mask(x: int, y: int, radius: int) -> np.ndarray:
    """Return the mask of a disc with a hole."""
    rows, columns = np.ogrid[: SIZE[1], : SIZE[0]]
    squared_distance = (columns - x) ** 2 + (rows - y) ** 2
    return (squared_distance <= radius**2) & (squared_distance > 4)


def photo_labels(key: PhotoKey) -> list[Annotation]:
    """Return five labels: two rocks with ids, one of them partly occluded, their shadows, and a rock without id."""
    shift = 6 if key.camera == "R" else 0
    near, far = rock_mask(150 - shift, 170, 30), rock_mask(185 - shift, 150, 25)
    side = 60 if key.azimuth == "30" else -60
    shadows = [rock_mask(150 - shift + side, 175, 20), rock_mask(185 - shift + side, 152, 15)]
    stray = rock_mask(300 - shift, 60, 8)
    visible = [near, far & ~near, shadows[0] & ~near & ~far, shadows[1] & ~near & ~far, stray]
    amodal_masks = [near, far, None, None, stray]
    named = [(ROCK, 4), (ROCK, 7), (SHADOW, 4), (SHADOW, 7), (ROCK, NO_ROCK)]
    labels = []
    for (kind, rock), mask, amodal_mask in zip(named, visible, amodal_masks, strict=True):
        box = box_of_mask(mask)
        amodal = None
        if amodal_mask is not None:
            amodal = Amodal(rle.encode_rle(amodal_mask, size=SIZE), box_of_mask(amodal_mask))
        labels.append(Annotation(kind, rock, box, rle.encode_rle(mask, size=SIZE), "fused", 0.75, amodal))
    return labels


def icosphere(centre: tuple[float, float], radius: float) -> Mesh:
    import trimesh

    ball = trimesh.creation.icosphere(subdivisions=2, radius=radius)
    return Mesh(ball.vertices + np.array([*centre, radius / 2]), ball.faces)


def make_run(root: Path, kind: str = "analog") -> Path:
    """Write a run and the photos listed in it below `root`."""
    run, terrain = root / "results/tiny", "Terrain01"
    rng = np.random.default_rng(8)
    domain_folder = {"photo": root / "photos", "hapke": run / "renders/hapke" / terrain}
    rows = []
    for key in KEYS:
        for folder in domain_folder.values():
            pixels = rng.integers(16, 4096, SIZE[::-1]).astype(np.uint16)
            png.write_png(folder / f"{key}.png", pixels)
        path = domain_folder["photo"] / f"{key}.png"
        file = {"width": SIZE[0], "height": SIZE[1], "bits": 16, "sha256": "", "path": str(path)}
        rows.append(key_columns(key) | file)
    write_parquet(run / "acquire" / terrain / "photos.parquet", pd.DataFrame(rows, columns=list(PHOTO_COLUMNS)))
    write_inventory(run / "acquire" / terrain / "inventory.json", Inventory(1, kind))
    labels = {key: photo_labels(key) for key in KEYS}
    for stage, source in (("labels", "fused"), ("renders", "rendered")):
        of_stage = {key: [replace(label, source=source) for label in labels[key]] for key in KEYS}
        coco.write_coco(run / stage / "coco" / f"{terrain}.json", of_stage, polar(), SIZE)
    localised = rigs.LocalisedRig(
        small_rig(), camera_pose(np.array([3.0, 0.0, 1.2]), np.pi, 0.4), "scans, photos", {"sd_mm": 1.5}
    )
    rigs.write_localised(run / "cameras" / terrain / "PosA.json", localised)
    lamps.write_suns(run / "cameras" / terrain, {"180": SUN_180})
    write_meshes(run / "meshes" / terrain)
    write_maps(run / "renders", terrain, rng)
    table = pd.DataFrame(
        [
            dict.fromkeys(ROCKS.columns, 0)
            | {"rock": rock, "x": x, "y": y, "z": r / 2, "size_m": 2 * r, "source": "scan", "points_by_scan": "A:9"}
            | {"confirmed": "A", "points": 9}
            for rock, (x, y, r) in ROCK_PLACES.items()
        ],
        columns=list(ROCKS.columns),
    )
    write_parquet(run / "rocks" / terrain / "rocks.parquet", table)
    write_csv(run / "detect/photo/split.csv", pd.DataFrame({"key": map(str, PARTS), "part": PARTS.values()}))
    write_evaluation(run)
    return run


def write_meshes(folder: Path) -> None:
    x, y = np.meshgrid(np.linspace(-2, 2, 9), np.linspace(-2, 2, 9))
    corners = np.arange(81).reshape(9, 9)
    a, b, c, d = (part.ravel() for part in (corners[:-1, :-1], corners[:-1, 1:], corners[1:, 1:], corners[1:, :-1]))
    ground = Mesh(np.stack([x.ravel(), y.ravel(), np.zeros(81)], 1), np.vstack([np.c_[a, b, c], np.c_[a, c, d]]))
    folder.mkdir(parents=True)
    obj.write_obj(folder / obj.ground_name(1), ground, "ground")
    names = [obj.ground_name(1)]
    for rock, (x0, y0, radius) in ROCK_PLACES.items():
        names.append(obj.rock_name(1, rock))
        obj.write_obj(folder / names[-1], icosphere((x0, y0), radius), f"rock{rock}")
    support = pd.DataFrame({"mesh": obj.rock_name(1, 4), "vertex": range(162), "support": np.linspace(0, 1, 162)})
    write_parquet(folder / "support.parquet", support)
    write_csv(folder / "meshes.csv", pd.DataFrame({"mesh": names, "made_from": "scan"}))
    write_walls(folder, level_walls(2.0, 0.3, "scans"))


def write_maps(renders: Path, terrain: str, rng: np.random.Generator) -> None:
    """Write instance maps of the twins, and maps per view and per exposure bracket."""
    for key in KEYS:
        bracket = str(key).rpartition("_")[0]
        ids = np.ones(SIZE[::-1], np.uint16)
        for label in reversed(photo_labels(key)):
            ids[label.mask.mask()] = (1000 if label.kind == ROCK else 2000) + max(label.rock, 0)
        png.write_png(renders / "instances" / terrain / f"{bracket}.png", ids)
        png.write_png(
            renders / "maps" / terrain / "incidence" / f"{bracket}.png", rng.integers(0, 9000, SIZE[::-1], np.uint16)
        )
    for camera in "LR":
        for name, shape in (("depth", SIZE[::-1]), ("normal", (*SIZE[::-1], 3))):
            values = rng.integers(0, 65535, shape, np.uint16)
            png.write_png(renders / "maps" / terrain / name / f"01_A_{camera}.png", values)


def write_evaluation(run: Path) -> None:
    row = {"stage": "labels", "terrain": 1, "subject": "rock", "metric": "F1", "value": 0.9375, "unit": "1", "n": 20}
    origin = {"against": "truth", "run": "tiny", "source": "analog", "config": "0123abcd"}
    write_parquet(run / "tables/evaluation.parquet", pd.DataFrame([row | origin]))


def content(folder: Path) -> dict[str, bytes]:
    """Return the content of all files of a folder by name."""
    return {path.relative_to(folder).as_posix(): path.read_bytes() for path in folder.rglob("*") if path.is_file()}
