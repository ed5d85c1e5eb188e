"""Damaged files of every format: 30 of each case, or the number in FUZZ_EXAMPLES (`make fuzz`: 10,000).

A reader returns a valid object (shapes, finite numbers, the written values where the format has checksums) or raises a
single line that names the file. `test_readers.py` tests the decorator that all readers share.
"""

import json
import os
import shutil
import zipfile
from collections.abc import Callable
from dataclasses import dataclass, fields, is_dataclass
from functools import partial
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from pydantic import BaseModel

from polarsim.acquire import archives, fetch
from polarsim.annotate.import_labels import import_labels
from polarsim.detect.detectors import files as detectors
from polarsim.errors import PolarsimError
from polarsim.formats import (
    bags,
    class_lists,
    coco,
    colmap,
    files,
    geotiff,
    nasa,
    npz,
    obj,
    ply,
    png,
    release,
    rle,
    ros,
    tables,
    yolo,
)
from polarsim.formats.calibrations import read_calibration
from polarsim.formats.clouds import read_cloud, write_cloud
from polarsim.formats.coco_annotations import Annotation
from polarsim.formats.yaml_files import read_model
from polarsim.geometry.meshes import Mesh
from polarsim.geometry.poses import Pose, camera_pose
from polarsim.photo import BOX_CLASSES, NO_ROCK, PhotoKey
from polarsim.rocks import overrides
from polarsim.run_files import class_masks, instances, lamps, rigs
from polarsim.run_files.inventory import Inventory, read_inventory, write_inventory
from polarsim.site import polar
from tests.acquire.test_other_site import kalibr
from tests.support.other_site import other_rig, other_site
from tests.support.polar_photos import HEIGHT, SIZE, WIDTH
from tests.support.polar_rig import default_rig

EXAMPLES = int(os.environ.get("FUZZ_EXAMPLES", "30"))
PLAUSIBLE = b"0123456789-+.eEnaif, \t\n/#\"'[]{}:x\\"
GARBAGE = (bytes([0]), bytes([0xFF]), bytes(range(256)))


@dataclass(frozen=True)
class Case:
    """A reader and a small valid file for it."""

    make: Callable[[Path], Any]  # writes into a folder; returns the file or folder to read
    read: Callable[[Any], Any]
    check: Callable[[Any], None] = lambda _: None  # properties of every valid object, besides finite numbers
    damaged: str = "*"  # pattern of the damaged files
    named: bool = True  # whether the reader knows the file name


def damage(content: bytes, rng: np.random.Generator) -> bytes:
    """Change 1 to 8 bytes, exchange two blocks, or truncate the content."""
    changed = bytearray(content)
    for place in rng.integers(0, len(changed), rng.integers(1, 9)):
        changed[place] = rng.choice(list(PLAUSIBLE)) if rng.random() < 0.5 else rng.integers(0, 256)
    if rng.random() < 0.3:
        length = int(rng.integers(1, 65))
        first, second = sorted(rng.integers(0, len(changed), 2).tolist())
        if first + length <= second and second + length <= len(changed):
            blocks = changed[first : first + length], changed[second : second + length]
            changed[first : first + length], changed[second : second + length] = blocks[1], blocks[0]
    return bytes(changed[: rng.integers(0, len(changed))] if rng.random() < 0.25 else changed)


def assert_finite(value: Any) -> None:
    if isinstance(value, np.ndarray | float | np.floating):
        assert np.asarray(value).dtype.kind not in "fc" or np.isfinite(value).all()
    elif is_dataclass(value):
        assert_finite([getattr(value, field.name) for field in fields(value)])
    elif isinstance(value, dict | list | tuple):
        for inner in value.values() if isinstance(value, dict) else value:
            assert_finite(inner)


def is_refused(case: Case, source: Any) -> bool:
    try:
        found = case.read(source)
    except PolarsimError as error:
        refusal = error
    else:
        assert_finite(found)
        case.check(found)
        return False
    assert len(str(refusal).splitlines()) == 1
    assert not case.named or refusal.path is not None
    return True


def text(name: str, content: str | bytes) -> Callable[[Path], Path]:
    return written(name, files.write_bytes, content.encode() if isinstance(content, str) else content)


def written(name: str, write: Callable[..., Any], *args: Any) -> Callable[[Path], Path]:
    """Return a function that writes a file with a writer of polarsim."""

    def make(folder: Path) -> Path:
        write(folder / name, *args)
        return folder / name

    return make


def folder_of(*makes: Callable[[Path], Path]) -> Callable[[Path], Path]:
    return lambda folder: [make(folder) for make in makes][-1].parent


def same(wanted: np.ndarray) -> Callable[[np.ndarray], None]:
    return lambda found: np.testing.assert_array_equal(found, wanted)


def shaped(*shape: int) -> Callable[[np.ndarray], None]:
    return lambda found: np.testing.assert_equal(found.shape, shape)


def valid_mesh(mesh: Mesh) -> None:
    assert mesh.vertices.shape == (len(mesh.vertices), 3)
    assert 0 <= mesh.faces.min() <= mesh.faces.max() < len(mesh.vertices)


def valid_boxes(labels: tuple[np.ndarray, np.ndarray]) -> None:
    classes, boxes = labels
    assert boxes.shape == (len(classes), 4)
    assert np.isin(classes, range(len(BOX_CLASSES))).all()
    assert (boxes[:, 2:] >= boxes[:, :2]).all()
    assert (np.abs(boxes) < 2 * WIDTH).all()


def valid_all(photos: dict[PhotoKey, Any]) -> None:
    for labels in photos.values():
        valid_boxes(labels)


def make_colmap(folder: Path) -> Path:
    rig = other_rig()
    colmap.write_model(folder / "model", {"A": rigs.LocalisedRig(rig, camera_pose(np.array([3.0, 0, 1]), np.pi, 0.4))})
    for name in ("rigs.txt", "frames.txt", "points3D.txt"):
        (folder / "model" / name).unlink()
    return folder / "model"


def make_opencv(folder: Path) -> Path:
    file = cv2.FileStorage(str(folder / "a.yaml"), cv2.FILE_STORAGE_WRITE)
    rig = other_rig()
    for side, lens in (("left", rig.left), ("right", rig.right)):
        file.write(f"camera_matrix_{side}", lens.opencv_matrix())
        file.write(f"distortion_coefficients_{side}", np.array([lens.distortion]))
    motion = rig.left_from_right.inverse()
    file.write("R", motion.rotation)
    file.write("T", motion.translation[:, None])
    file.release()
    return folder / "a.yaml"


def valid_lens(rig: Any) -> None:
    assert min(rig.left.fx, rig.left.fy, rig.right.fx, rig.right.fy) > 0
    assert np.allclose(np.linalg.det(rig.left_from_right.rotation), 1)


def valid_coco(photos: dict[PhotoKey, list[Annotation]]) -> None:
    for labels in photos.values():
        for label in labels:
            assert (label.box[2:] > label.box[:2]).all()
            assert label.rock >= NO_ROCK
            assert label.mask is None or label.mask.mask().shape == (HEIGHT, WIDTH)


def zipped(name: str, contents: dict[str, bytes]) -> Callable[[Path], Path]:
    def make(folder: Path) -> Path:
        with zipfile.ZipFile(folder / name, "w") as archive:
            for entry, content in contents.items():
                archive.writestr(zipfile.ZipInfo(entry), content, zipfile.ZIP_DEFLATED)
        return folder / name

    return make


def unpacked(path: Path) -> list[bytes]:
    out = path.parent / "out"
    shutil.rmtree(out, ignore_errors=True)
    archives.unpack(path, out)
    return [path.read_bytes() for path in out.rglob("*") if path.is_file()]


def imported(source: Path) -> dict[PhotoKey, Any]:
    out = source.parent / f"{source.name}.out"
    try:
        import_labels(source, out, site=polar())
        return {PhotoKey.parse(path.stem): yolo.read_boxes(path, size=SIZE) for path in out.glob("*.txt")}
    finally:
        shutil.rmtree(out, ignore_errors=True)


def make_bag(folder: Path) -> Path:
    messages = [
        (n, "/tf", "geometry_msgs/msg/TransformStamped", ros.transform(n, "a", "b", Pose.identity())) for n in (1, 2)
    ]
    bags.write_mcap_bag(folder / "a.mcap", [iter(messages)])
    return folder / "a.mcap"


def make_detector(folder: Path) -> Path:
    import torch

    state = {"weight": torch.arange(6, dtype=torch.float16).reshape(2, 3)}
    detectors.write_detector(folder / "a.pt", detectors.Detector("compact", 160, 2, "scratch", state))
    return folder / "a.pt"


def make_geotiff(folder: Path) -> Path:
    import rasterio

    place = {"crs": "EPSG:32633", "transform": rasterio.Affine(1.0, 0, 500_000.0, 0, -1.0, 4_000_000.0)}
    shape = {"width": 8, "height": 8, "count": 1, "dtype": "float32"}
    with rasterio.open(folder / "a.tif", "w", driver="GTiff", **shape, **place) as made:
        made.write(np.arange(64, dtype=np.float32).reshape(8, 8), 1)
    return folder / "a.tif"


class Options(BaseModel, extra="forbid"):
    run: str
    seed: int = 0
    lamps: dict[str, list[float]] | None = None


RNG = np.random.default_rng(1)
KEY = PhotoKey.parse("01_A_off_30_L_0256")
PIXELS = RNG.integers(0, 4096, (12, 16)).astype(np.uint16)
POINTS = np.abs(RNG.normal(1.5, 0.1, (12, 16, 3))).astype(np.float32)
TETRAHEDRON = Mesh(np.eye(4, 3), np.array([[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]]))
MASK = rle.encode_rle(np.ones((15, 20)), SIZE, 100, 100)
read_coco = partial(coco.read_coco, size=SIZE, key_of=polar().key_of_picture)
write_polygons = partial(coco.write_coco, site=polar(), size=SIZE, simplify_px=0.5)
BOXES = np.array([[100.0, 200, 150, 230], [60, 210, 105, 230]])
LABELS = {KEY: [Annotation("rock", 4, BOXES[0], MASK), Annotation("shadow", 4, BOXES[1])]}
ROW = {"kind": "rock", "rock": 4, "source": "seed", "confidence": 1.0, "x0": 1.0, "y0": 2.0, "x1": 3.0, "y1": 4.0}
TABLE = tables.label_table([tables.key_columns(KEY) | ROW] * 3)
LOCALISED = rigs.LocalisedRig(default_rig(), camera_pose(np.array([3.6, -0.4, 1.5]), np.pi, 0.44, -0.01), "scans")
YOLO_BOXES = "0 0.06456 0.1768 0.02583 0.02467\n1 0.04261 0.18092 0.02324 0.01645\n"
YOLO_RING = "2 0.030992 0.172697 0.054236 0.172697 0.054236 0.189145 0.030992 0.1875\n"
CVAT = f"""<?xml version="1.0" encoding="utf-8"?>
<annotations><image id="0" name="some/{KEY}.png" width="968" height="608">
<box label="rock" xtl="50" ytl="100" xbr="75" ybr="115"/><polygon label="shadow" points="30,105;52.5,110;40,115"/>
<mask label="rock" rle="21, 3, 17, 3, 156" left="300" top="400" width="20" height="10"/>
<ellipse label="rock" cx="700" cy="500" rx="40" ry="10" rotation="20"/><tag label="rock"/>
</image></annotations>"""
RECTANGLE = {"x": 10, "y": 20, "width": 3, "height": 2, "rotation": 0, "rectanglelabels": ["rock"]}
STUDIO = [{"data": {"image": f"/data/1a2b-{KEY}.png"}, "annotations": [{"result": [{"value": RECTANGLE}]}]}]
BRUSH = {"format": "rle", "brushlabels": ["rock"], "original_width": 8, "original_height": 5,
         "rle": [0, 0, 0, 160, 57, 27, 254, 39, 0, 191, 255, 124, 2, 255, 254, 71, 0, 0]}  # fmt: skip
ELLIPSE = {"x": 10, "y": 20, "radiusX": 3, "radiusY": 2, "rotation": 9, "ellipselabels": ["shadow"]}
STUDIO_MIN = [{"photo": f"{KEY}.png", "control": [RECTANGLE, ELLIPSE], "other": [BRUSH], "id": 3}]
ENTRIES = {"one.txt": b"some text " * 20, "two/three.txt": bytes(range(256))}
POLYGONAL_OBJ = "v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nv 1 1 0\nf 1/1 2/1 4/1 3/1\nf -1 -2 -3\n"
YAML = "run: demo\nseed: 3\nlamps: {a: [1.0, 2, 3], b: &b [4, 5]}\n"

CASES = {
    "bag": Case(make_bag, lambda path: bags.bag_metadata(path, "a.mcap")),
    "calibration": Case(
        written("a.calibration", nasa.write_calibration, default_rig()),
        lambda path: read_calibration(path, polar()),
        valid_lens,
    ),
    "calibration of Kalibr": Case(
        written("camchain.yaml", files.write_text, kalibr(other_rig())),
        lambda path: read_calibration(path, other_site()),
        valid_lens,
    ),
    "calibration of COLMAP": Case(
        lambda folder: make_colmap(folder) / "cameras.txt",
        lambda path: read_calibration(path, other_site()),
        valid_lens,
        damaged="model/*.txt",
        named=False,  # or images.txt
    ),
    "calibration of OpenCV": Case(
        make_opencv,
        lambda path: read_calibration(path, other_site()),
        valid_lens,
    ),
    "cloud": Case(
        written("a.xyz", write_cloud, POINTS[0], np.arange(16)),
        read_cloud,
        lambda found: shaped(len(found), 3)(found),
    ),
    "cloud in PLY": Case(
        written("a.ply", ply.write_ply, ply.Cloud(POINTS[0], POINTS[0])),
        read_cloud,
        lambda found: shaped(len(found), 3)(found),
    ),
    "COCO": Case(written("a.json", coco.write_coco, LABELS, polar(), SIZE), read_coco, valid_coco),
    "COCO polygons": Case(written("a.json", write_polygons, LABELS), read_coco, valid_coco),
    "CSV": Case(written("a.csv", tables.write_csv, TABLE), lambda path: tables.read_csv(path, tables.LABEL_COLUMNS)),
    "detector": Case(make_detector, detectors.read_detector),
    "GeoTIFF": Case(make_geotiff, lambda path: geotiff.read_elevation(path, 2.0, 3.0)),
    "checksums of archives": Case(folder_of(text(fetch.PINS, json.dumps({"a.zip": "0" * 64}))), fetch.read_pins),
    "JSON": Case(text("a.json", json.dumps({"a": [1, 2.5, None], "b": {"c": "d"}})), files.read_json),
    "class mask": Case(
        written("a.png", class_masks.write_class_mask, (PIXELS % 3).astype(np.uint8)), class_masks.read_class_mask
    ),
    "instances": Case(written("a.png", png.write_png, PIXELS), instances.read_instances, shaped(12, 16)),
    "inventory": Case(
        written("a.json", write_inventory, Inventory(3, "release", meshes={"4": "a.obj"}, clouds={"A": "a.xyz"})),
        lambda path: read_inventory(path).rock_meshes(),
    ),
    "lamps": Case(
        written("lamps.json", lambda path: lamps.write_suns(path.parent, {"30": np.array([3.5, 1.4, 0.7])})),
        lambda path: lamps.read_localised_suns(path.parent),
    ),
    "overrides of rocks": Case(
        text("a.yaml", "- {rock: 5, min: [0, 0, 0], max: [0.2, 0.2, 0.1]}\n- {rock: 6, at: [1, 1]}\n- {drop: [7]}\n"),
        overrides.read_overrides,
    ),
    "NPZ": Case(
        written("a.npz", lambda path: npz.write_arrays(path, level=POINTS[0])),
        lambda path: npz.read_arrays(path, ("level",))["level"],
        same(POINTS[0]),
    ),
    "OBJ": Case(written("a.obj", obj.write_obj, TETRAHEDRON, "rock"), obj.read_obj, valid_mesh),
    "OBJ with polygons": Case(text("a.obj", POLYGONAL_OBJ), obj.read_obj, valid_mesh),
    "Parquet": Case(
        written("a.parquet", tables.write_parquet, TABLE),
        lambda path: tables.read_parquet(path, tables.LABEL_COLUMNS),
    ),
    "PLY": Case(written("a.ply", ply.write_ply, ply.Cloud(POINTS[0], POINTS[0])), ply.read_ply),
    "PNG": Case(written("a.png", png.write_png, PIXELS), png.read_png, same(PIXELS)),
    "PNG in colour": Case(
        written("a.png", png.write_png, np.dstack([PIXELS] * 3).astype(np.uint8)), png.read_png, shaped(12, 16, 3)
    ),
    "range map": Case(
        written("a.tif", nasa.write_range_map, POINTS),
        lambda path: np.nan_to_num(nasa.read_range_map(path, (16, 12))),
        shaped(12, 16, 3),
    ),
    "rig": Case(
        written("PosA.json", rigs.write_localised, LOCALISED),
        rigs.read_localised,
        lambda found: valid_lens(found.rig),
    ),
    "runs": Case(
        text("a.txt", MASK.counts),
        lambda path: rle.from_text(path.read_text("latin-1"), SIZE).mask(),
        shaped(HEIGHT, WIDTH),
        named=False,
    ),
    "YAML": Case(text("a.yaml", YAML), lambda path: read_model(path, Options, "the file")),
    "YOLO": Case(text("a.txt", YOLO_BOXES), partial(yolo.read_boxes, size=SIZE), valid_boxes),
    "YOLO detections": Case(
        text("a.txt", YOLO_BOXES.replace("\n", " 0.5\n")),
        partial(yolo.read_detections, size=SIZE),
        lambda found: np.testing.assert_equal([len(part) for part in found], [len(found[0])] * 3),
    ),
    "YOLO polygons": Case(text("a.txt", YOLO_RING * 2), partial(yolo.read_boxes_or_polygons, size=SIZE), valid_boxes),
    "YOLO folder": Case(
        folder_of(text(f"{KEY}.txt", YOLO_BOXES), text(class_lists.CLASS_FILE, "rock\nshadow\n")),
        partial(release.read_annotated_boxes, size=SIZE, key_of=polar().key),
        valid_all,
    ),
    "zip": Case(
        zipped("a.zip", ENTRIES),
        unpacked,
        lambda found: np.testing.assert_equal(set(found) <= {*ENTRIES.values(), b""}, True),
        "a.zip",
    ),
    "import of CVAT": Case(text("a.xml", CVAT), imported, valid_all),
    "import of Label Studio": Case(text("tasks.json", json.dumps(STUDIO)), imported, valid_all),
    "import of JSON-MIN": Case(text("tasks.json", json.dumps(STUDIO_MIN)), imported, valid_all),
    "import of a zip": Case(
        zipped("a.zip", {"annotations.xml": CVAT.encode(), "images/a.png": ENTRIES["two/three.txt"]}),
        imported,
        valid_all,
        "a.zip",
    ),
    "import of YOLO": Case(
        folder_of(text(f"set/{KEY}.txt", YOLO_BOXES), text("set/data.yaml", "names: [rock, shadow]\n")),
        imported,
        valid_all,
        "set/*",
    ),
    **{
        f"size of {name}": Case(
            text(name, cv2.imencode(name[1:], PIXELS // divisor)[1].tobytes()),
            png.size,
            lambda found: np.testing.assert_equal(min(found) >= 0, True),
        )
        for name, divisor in (("a.tif", 1), ("a.jpg", 16), ("a.webp", 16), ("a.bmp", 16))
    },
    **{
        f"classes in {name}": Case(folder_of(text(name, content)), class_lists.find_classes)
        for name, content in (
            ("data.yaml", "names: {0: rock, 1: shadow}\n"),
            ("notes.json", '{"categories": [{"id": 0, "name": "rock"}]}'),
            ("obj.names", "rock\nshadow\n"),
        )
    },
}


@pytest.mark.parametrize("name", CASES)
def test_a_damaged_file_gives_a_valid_object_or_a_one_line_error(name, tmp_path):
    case = CASES[name]
    source = case.make(tmp_path)
    assert not is_refused(case, source)
    contents = {path: path.read_bytes() for path in sorted(tmp_path.glob(case.damaged)) if path.is_file()}
    refused = []
    for number in range(EXAMPLES):
        rng = np.random.default_rng(number)
        path = list(contents)[rng.integers(len(contents))]
        path.write_bytes(damage(contents[path], rng))
        is_refused(case, source)
        path.write_bytes(contents[path])
    for path, content in contents.items():
        for each in GARBAGE:
            path.write_bytes(each * (len(content) // len(each) + 1))
            refused.append(is_refused(case, source))
        path.write_bytes(content)
    assert any(refused)  # the drawn damages may all be harmless


def test_a_missing_file_is_said_to_be_missing(tmp_path):
    optional = {"checksums of archives", "lamps", "runs", *(name for name in CASES if name.startswith("classes in "))}
    for name in CASES.keys() - optional:
        with pytest.raises(PolarsimError) as caught:
            CASES[name].read(tmp_path / "missing.ply")
        assert "no such" in caught.value.reason.lower(), name
