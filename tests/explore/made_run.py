"""A small run for the explorer: one terrain and station, two rocks, small images, one drive."""

from pathlib import Path

import numpy as np
import pandas as pd

from polarsim.formats import obj, png, yolo
from polarsim.formats.files import write_json
from polarsim.formats.npz import write_arrays
from polarsim.formats.tables import PHOTO_COLUMNS, key_columns, label_table, write_csv, write_parquet
from polarsim.geometry.poses import camera_pose
from polarsim.photo import BOX_CLASSES, PhotoKey
from polarsim.run_files.rigs import LocalisedRig, write_localised
from polarsim.schemas.detect import PREDICTIONS
from polarsim.site import polar
from tests.made_terrain import ROCKS, make_cube, make_sand
from tests.support.label_rows import label_row
from tests.support.polar_photos import HEIGHT, WIDTH
from tests.support.polar_rig import default_rig

TERRAIN, FOLDER = 3, "Terrain03"
SIZE = (152, 242)  # rows and columns of the images, an eighth of a photo
MODELS = ("hapke", "principled")
KEYS = [
    key
    for key in polar().photos_of(TERRAIN)
    if key.position == "A" and key.exposure_ms in ((512, 2048) if key.azimuth == "no" else (64, 256, 1024))
]
SEED = PhotoKey.parse("03_A_off_30_L_0256")
MESHES = {number: make_cube((x, y, side / 4), side) for number, ((x, y), side) in ROCKS.items()}
RIG = LocalisedRig(default_rig(), camera_pose(np.array([3.6, -0.4, 1.5]), np.pi, np.radians(25)), "scans", {})


def boxes_of(key: PhotoKey) -> dict[tuple[str, int], np.ndarray]:
    """Return boxes (4,) by kind and rock: rocks at the meshes, shadows next to the rocks."""
    found = {}
    for rock, mesh in MESHES.items():
        pixels = RIG.project(key.camera, mesh.vertices)
        box = np.concatenate([pixels.min(axis=0), pixels.max(axis=0)])
        found["rock", rock] = box
        if key.azimuth != "no":
            found["shadow", rock] = box + np.array([40, 20, 40, 20])
    return found


def label_rows(keys: list[PhotoKey]) -> list[dict[str, object]]:
    return [
        label_row(
            key, kind, rock, box, source="seed" if key == SEED else "fused", confidence=0.99 if rock == 1 else 0.4
        )
        for key in keys
        for (kind, rock), box in boxes_of(key).items()
    ]


def picture(key: PhotoKey, gain: float) -> np.ndarray:
    """Return 12-bit values proportional to the exposure, with bright rocks and dark shadows."""
    light = np.full(SIZE, gain * key.exposure_ms * (0.2 if key.azimuth == "no" else 1.0))
    scale = SIZE[1] / WIDTH
    for (kind, _), box in sorted(boxes_of(key).items(), reverse=True):
        x0, y0, x1, y1 = np.round(box * scale).astype(int).clip(0)
        light[y0 : y1 + 1, x0 : x1 + 1] *= 1.6 if kind == "rock" else 0.2
    return np.clip(16 + light, 0, 4095).astype(np.uint16)


def make_run(results: Path, name: str = "made") -> Path:
    """Write the run below a folder of results."""
    run = results / name
    photos = []
    for key in KEYS:
        path = results / "photos" / f"{key}.png"
        png.write_png(path, picture(key, 2.0))
        photos.append(
            {**key_columns(key), "width": WIDTH, "height": HEIGHT, "bits": 16, "sha256": "", "path": str(path)}
        )
        for model, gain in zip(MODELS, (1.8, 2.4), strict=True):
            png.write_png(run / f"renders/{model}/{FOLDER}/{key}.png", picture(key, gain))
        classes = np.array([BOX_CLASSES.index(kind) for kind, _ in boxes_of(key)])
        yolo.write_boxes(
            run / f"labels/boxes/{FOLDER}/{key}.txt",
            classes,
            np.array(list(boxes_of(key).values())),
            size=(WIDTH, HEIGHT),
        )
    write_parquet(run / f"acquire/{FOLDER}/photos.parquet", pd.DataFrame(photos, columns=list(PHOTO_COLUMNS)))
    for stage in ("labels", "renders"):
        write_parquet(run / f"{stage}/tables/{FOLDER}.parquet", label_table(label_rows(KEYS)))
    _write_masks(run)
    _write_terrain(run)
    _write_scores(run)
    _write_drive(run / "rover/seed0")
    return run


def _write_masks(run: Path) -> None:
    for key in KEYS:
        rings = []
        ids = np.ones((HEIGHT, WIDTH), np.uint16)
        for (kind, rock), box in sorted(boxes_of(key).items(), reverse=True):
            x0, y0, x1, y1 = np.round(box).astype(int).clip(0)
            rings.append((2 if kind == "rock" else 3, np.array([[x0, y0], [x1, y0], [x1, y1], [x0, y1]], float)))
            ids[y0:y1, x0:x1] = (1000 if kind == "rock" else 2000) + rock
        yolo.write_polygons(run / f"labels/polygons/{FOLDER}/{key}.txt", rings, size=(WIDTH, HEIGHT))
        path = run / f"renders/instances/{FOLDER}/{str(key).rpartition('_')[0]}.png"
        if not path.exists():
            png.write_png(path, ids)


def _write_terrain(run: Path) -> None:
    write_localised(run / f"cameras/{FOLDER}/PosA.json", RIG)
    meshes = run / f"meshes/{FOLDER}"
    obj.write_obj(meshes / obj.ground_name(TERRAIN), make_sand(), "ground")
    rows, offsets = [], []
    for rock, mesh in MESHES.items():
        obj.write_obj(meshes / obj.rock_name(TERRAIN, rock), mesh, f"rock{rock}")
        (x, y), side = ROCKS[rock]
        rows.append({"rock": rock, "x": x, "y": y, "z": side / 4, "size_m": side, "source": "scan"})
        offsets += [{"rock": rock, "x": a, "y": b, "z": c, "offset_mm": 3.0 * rock} for a, b, c in mesh.vertices]
    write_parquet(run / f"rocks/{FOLDER}/rocks.parquet", pd.DataFrame(rows))
    write_parquet(run / f"evaluation/offsets_{FOLDER}.parquet", pd.DataFrame(offsets))
    support = pd.DataFrame({"mesh": obj.rock_name(TERRAIN, 1), "vertex": range(8), "support": np.arange(8) / 7})
    write_parquet(meshes / "support.parquet", support)


def _write_scores(run: Path) -> None:
    pairs = [{"key": str(key), "iou_best": 0.9 if key.camera == "L" else 0.6} for key in KEYS]
    write_parquet(run / f"evaluation/label_pairs_{FOLDER}.parquet", pd.DataFrame(pairs))
    twins = [{"key": str(key), "model": model, "ssim": 0.5} for key in KEYS for model in MODELS]
    write_parquet(run / f"evaluation/appearance_{FOLDER}.parquet", pd.DataFrame(twins))
    states = pd.DataFrame({"key": [str(key) for key in KEYS], "state": "used"})
    states.loc[0, "state"] = "dark"
    write_csv(run / "detect/pictures/analog/pictures.csv", states)
    seen = []
    for key in KEYS[:6]:  # two boxes for the large rock, no box for the small rock, a false positive in a corner
        x0, y0, x1, y1 = boxes_of(key)["rock", 1]
        found = ((0.9, x0, y0, x1, y1), (0.6, x0 + 2, y0, x1, y1 + 2), (0.8, 20, 1100, 90, 1190), (0.01, 0, 0, 9, 9))
        seen += [dict(zip(PREDICTIONS.columns, (str(key), "rock", *one), strict=True)) for one in found]
    write_parquet(run / "detect/photo/seed0/predictions/analog_on_analog.parquet", pd.DataFrame(seen))
    yolo.write_boxes(
        run / f"acquire/{FOLDER}/seeds/{SEED}.txt", np.array([0]), boxes_of(SEED)["rock", 1][None], size=(WIDTH, HEIGHT)
    )
    undone = [(str(key), "rock", 1, "moved", 3.5) for key in KEYS[:4]] + [(str(SEED), "rock", 2, "gone", np.nan)]
    columns = ["key", "kind", "rock", "change", "moved_px"]
    write_parquet(run / f"labels/undone/{SEED}.parquet", pd.DataFrame(undone, columns=columns))


def _write_drive(folder: Path) -> None:
    x, y = np.meshgrid(np.linspace(0, 6, 61), np.linspace(-2, 2, 41))
    write_arrays(
        folder / "world/ground.npz",
        x0_m=np.float64(0),
        y0_m=np.float64(-2),
        cell_m=np.float64(0.1),
        level_m=0.1 * np.sin(x + y),
    )
    time = np.arange(0, 20, 0.1)
    trace = pd.DataFrame({"time_s": time, "x_m": 0.5 + 0.2 * time, "y_m": 0.5 * np.sin(time / 4)})
    write_parquet(folder / "trace.parquet", trace)
    stones = {"terrain": 3, "rock_in_terrain": [1, 2], "x_m": [2.0, 4.0], "y_m": [-1.0, 1.0], "radius_m": [0.2, 0.06]}
    write_parquet(folder / "world/rocks.parquet", pd.DataFrame(stones))
    poses = trace.iloc[::50].reset_index(drop=True).assign(frame=range(4))
    write_parquet(folder / "front_left/poses.parquet", poses[["frame", "time_s", "x_m", "y_m"]])
    for frame in range(3):
        png.write_png(
            folder / f"front_left/1_hapke_0064/{frame:05d}.png", np.full((60, 96), 500 * (frame + 1), np.uint16)
        )
    write_json(folder / "drive.json", {})
