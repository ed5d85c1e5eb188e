"""A small valid file for every reader, ways to damage it, and the check of what the reader returns.

Metrics of the last `make fuzz`: docs/notes/faults.md.
"""

from __future__ import annotations

import json
import shutil
import zipfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, fields, is_dataclass
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pandas as pd
from hypothesis import strategies as st

from polarsim.acquire import archives, fetch, index
from polarsim.annotate import import_labels
from polarsim.detect.detectors import files as detectors
from polarsim.errors import PolarsimError
from polarsim.formats import (
    bags,
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
    text_fields,
    yaml_files,
    yolo,
)
from polarsim.geometry.lens import Lens
from polarsim.geometry.meshes import Mesh
from polarsim.geometry.poses import Pose, camera_pose
from polarsim.geometry.stereo import StereoRig, default_rig
from polarsim.photo import BOX_CLASSES, HEIGHT, NO_ROCK, POLYGON_CLASSES, SUNS, WIDTH, PhotoKey
from polarsim.run_files import (
    best_photos,
    class_masks,
    instances,
    inventory,
    lamps,
    materials,
    rigs,
    rock_translations,
    scans,
    scene,  # fmt: skip
)
from polarsim.run_files import pictures as run_files
from polarsim.run_files.rigs import LocalisedRig

KEY = PhotoKey.parse("01_A_off_30_L_0256")
RIG = StereoRig(default_rig().left.scaled(0.02), default_rig().right.scaled(0.02), default_rig().left_from_right)
LOCALISED = LocalisedRig(
    default_rig(), camera_pose(np.array([3.6, -0.4, 1.5]), np.pi, 0.44, -0.01), "scans", {"rmse_mm": 1}
)
TETRAHEDRON = Mesh(
    np.array([[0.0, 0, 0], [0.1, 0, 0], [0, 0.1, 0], [0, 0, 0.1]]),
    np.array([[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]]),
)
TERRAIN = scene.TerrainMesh(np.arange(24.0).reshape(8, 3), np.array([[0, 1, 2], [3, 4, 5]]), np.array([NO_ROCK, 7]))


@dataclass(frozen=True)
class Case:
    """A reader and a small valid file for it."""

    make: Callable[[Path], Any]  # writes into a folder; returns the file or folder to read
    read: Callable[[Any], Any]
    check: Callable[[Any], None] = lambda _: None  # properties of every valid object, besides finite numbers
    harmed: str = "*"  # glob of the damaged files
    named: bool = True  # whether the reader knows the file name
    missing: tuple[str, ...] = ()  # fields that may be NaN


Change = tuple[int, int]
PLAUSIBLE = b"0123456789-+.eEnaif, \t\n/#\"'[]{}:x\\"


@dataclass(frozen=True)
class Damage:
    """Changed bytes, two swapped blocks, truncation; positions are fractions of the file size in 1/65,536."""

    changes: list[Change]
    swap: tuple[int, int, int] | None
    cut: int | None

    def apply(self, content: bytes) -> bytes:
        harmed = bytearray(content)
        for place, value in self.changes if harmed else ():
            harmed[place * len(harmed) >> 16] = value
        if self.swap:
            length = self.swap[2]
            one, other = sorted(place * len(harmed) >> 16 for place in self.swap[:2])
            if one + length <= other:
                blocks = harmed[one : one + length], harmed[other : other + length]
                harmed[one : one + length], harmed[other : other + length] = blocks[1], blocks[0]
        return bytes(harmed if self.cut is None else harmed[: self.cut * len(harmed) >> 16])


_PLACES = st.integers(0, (1 << 16) - 1)
DAMAGES = st.builds(
    Damage,
    st.lists(st.tuples(_PLACES, st.one_of(st.sampled_from(PLAUSIBLE), st.integers(0, 255))), min_size=1, max_size=8),
    st.none() | st.none() | st.tuples(_PLACES, _PLACES, st.integers(1, 64)),
    st.none() | st.none() | st.none() | _PLACES,
)


def finite(value: Any, missing: tuple[str, ...] = (), name: str = "") -> None:
    """Check that every number in a value is finite, except in fields of these names."""
    if name in missing:
        return
    if isinstance(value, np.ndarray | float | np.floating):
        values = np.asarray(value)
        assert values.dtype.kind != "O", f"objects in {name}"
        assert values.dtype.kind not in "fc" or np.isfinite(values).all(), f"{name} is not finite"
    elif is_dataclass(value):
        for field in fields(value):
            finite(getattr(value, field.name), missing, field.name)
    elif isinstance(value, dict):
        for key, inner in value.items():
            finite(inner, missing, str(key))
    elif isinstance(value, list | tuple):
        for inner in value:
            finite(inner, missing, name)


def text(name: str, content: str) -> Callable[[Path], Path]:
    def make(folder: Path) -> Path:
        path = folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(content, encoding="utf-8")
        return path

    return make


def file(name: str, write: Callable[..., Any], *args: Any, **kwargs: Any) -> Callable[[Path], Path]:
    """Return a file written by a writer of polarsim."""

    def make(folder: Path) -> Path:
        write(folder / name, *args, **kwargs)
        return folder / name

    return make


def content(name: str, made: bytes) -> Callable[[Path], Path]:
    return file(name, files.write_bytes, made)


def the_folder(*makes: Callable[[Path], Path]) -> Callable[[Path], Path]:
    def make(folder: Path) -> Path:
        for one in makes:
            one(folder)
        return folder

    return make


# Properties of valid objects.


def sound_mesh(mesh: Any) -> None:
    assert mesh.vertices.ndim == 2
    assert mesh.vertices.shape[1] == 3
    assert mesh.faces.shape[1] == 3
    assert mesh.faces.dtype.kind == "i"
    assert mesh.faces.min() >= 0
    assert mesh.faces.max() < len(mesh.vertices)


def sound_boxes(found: tuple[np.ndarray, np.ndarray]) -> None:
    classes, boxes = found[:2]
    assert classes.dtype.kind == "i"
    assert boxes.shape == (len(classes), 4)
    assert (classes >= 0).all()
    assert (boxes[:, 2:] >= boxes[:, :2]).all()


def own_boxes(found: tuple[np.ndarray, np.ndarray]) -> None:
    sound_boxes(found)
    assert (found[0] < len(BOX_CLASSES)).all()
    assert (np.abs(found[1]) < 2 * WIDTH).all()


def sound_polygons(found: Any) -> None:
    for number, ring in found:
        assert 0 <= number < len(POLYGON_CLASSES)
        assert len(ring) >= 3
        assert (np.abs(ring) <= coco.MAX_POLYGON_COORDINATE_PX).all()


def sound_lens(lens: Lens) -> None:
    assert lens.fx > 0
    assert lens.fy > 0
    assert 0 < lens.width <= 1 << 16
    assert 0 < lens.height <= 1 << 16
    assert len(lens.distortion) == 5


def sound_rig(rig: StereoRig) -> None:
    sound_lens(rig.left)
    sound_lens(rig.right)
    assert np.allclose(np.linalg.det(rig.left_from_right.rotation), 1)


def sound_localised(localised: LocalisedRig) -> None:
    sound_rig(localised.rig)
    assert np.allclose(np.linalg.det(localised.sandbox_from_left.rotation), 1)
    assert isinstance(localised.method, str)
    assert all(isinstance(value, int | float) for value in localised.metrics.values())


def sound_cloud(points: np.ndarray) -> None:
    assert points.ndim == 2
    assert points.shape[1] == 3
    assert len(points)


def sound_coco(photos: Any) -> None:
    for key, labels in photos.items():
        assert isinstance(key, PhotoKey)
        for one in labels:
            assert one.box.shape == (4,)
            assert (one.box[2:] > one.box[:2]).all()
            assert one.rock >= NO_ROCK
            for mask in (one.mask, one.amodal.mask if one.amodal else None):
                assert mask is None or mask.mask().shape == (mask.height, mask.width)


def sound_inventory(found: inventory.Inventory) -> None:
    assert isinstance(found.terrain, int)
    assert isinstance(found.kind, str)
    for paths in (found.range_maps, found.clouds, found.meshes, found.cover_photos):
        assert all(isinstance(word, str) for pair in paths.items() for word in pair)
    assert all(isinstance(name, str) for name in (found.calibration, found.ground, *found.stray))


def same(wanted: np.ndarray) -> Callable[[np.ndarray], None]:
    """Check that a format with checksums returns the written content or raises an error."""
    return lambda found: np.testing.assert_array_equal(found, wanted)


# Files.

RNG = np.random.default_rng(1)
PIXELS = RNG.integers(0, 4096, (12, 16)).astype(np.uint16)
IDS = np.array([[0, 1, 2, 1003], [1003, 2003, 3, 0]], np.uint16)
CLASS_MASK = np.array([[0, 1, 2, class_masks.IGNORED], [2, 2, 0, 0]], np.uint8)
POINTS = np.abs(RNG.normal(1.5, 0.1, (*RIG.left.shape, 3))).astype(np.float32)
BOXES = np.array([[100.0, 200, 150, 230], [60, 210, 105, 230]])
RING = np.array([[60.0, 210], [105, 210], [105, 230], [60, 228]])
MASK = rle.encode_rle(np.ones((15, 20)), 100, 100)
LABELS = {KEY: [coco.Annotation("rock", 4, BOXES[0], MASK), coco.Annotation("shadow", 4, BOXES[1])]}
MADE = tables.label_table([{**tables.key_columns(KEY), "kind": "rock", "rock": 4, "source": "seed", "confidence": 1.0,
                            "x0": 1.0, "y0": 2.0, "x1": 3.0, "y1": 4.0}] * 3)  # fmt: skip
FIT = materials.FittedMaterial(
    {"albedo": 0.2}, {"30": 1.5}, {7: 1.25}, np.linspace(0.5, 1.2, 8, dtype=np.float32), {"a": 1}
)
FITTED = materials.FittedMaterials(True, False, {"lambert": FIT}, np.arange(8))
INVENTORY = inventory.Inventory(1, "analog", "a/stereo.calibration", {"A": "m.tif"}, {}, {"3": "r.obj"}, "g.obj",
                                {"A": "c.png"}, ("x",))  # fmt: skip
PHOTO = png.encode_png(np.zeros((HEIGHT, WIDTH), np.uint16))
DETECTOR = detectors.Detector("compact", 160, 2, "scratch", {}, (((160, 320), (0.5,)),) * 2, ((1.0, 0.0),) * 2)
YOLO_BOXES = "0 0.06456 0.1768 0.02583 0.02467\n1 0.04261 0.18092 0.02324 0.01645\n"
YOLO_RING = "2 " + " ".join(f"{x / WIDTH:.6f} {y / HEIGHT:.6f}" for x, y in RING) + "\n"
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


def positive_size(found: tuple[int, int]) -> None:
    assert min(found) >= 0


def make_zip(folder: Path) -> Path:
    with zipfile.ZipFile(folder / "a.zip", "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr(zipfile.ZipInfo("one.txt"), b"some text " * 20, zipfile.ZIP_DEFLATED)
        archive.writestr(zipfile.ZipInfo("two/three.txt"), bytes(range(256)))
    return folder / "a.zip"


def zipped_export(folder: Path) -> Path:
    with zipfile.ZipFile(folder / "export.zip", "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr(zipfile.ZipInfo("annotations.xml"), CVAT)
        archive.writestr(zipfile.ZipInfo("images/a.png"), bytes(range(256)))
    return folder / "export.zip"


def unpacked(path: Path) -> dict[str, bytes]:
    out = path.parent / "out"
    shutil.rmtree(out, ignore_errors=True)
    archives.unpack(path, out)
    return {str(one.relative_to(out)): one.read_bytes() for one in out.rglob("*") if one.is_file()}


def whole_zip(found: dict[str, bytes]) -> None:
    """Check the content of entries, which have checksums; names have no checksum."""
    assert all(one in (b"some text " * 20, bytes(range(256)), b"") for one in found.values())


def make_bag(folder: Path) -> Path:
    messages = [
        (n, "/tf", "geometry_msgs/msg/TransformStamped", ros.transform(n, "a", "b", Pose.identity())) for n in (1, 2)
    ]
    bags.write_mcap_bag(folder / "a.mcap", [iter(messages)])
    return folder / "a.mcap"


def make_detector(folder: Path) -> Path:
    import torch

    state = {"weight": torch.arange(6, dtype=torch.float16).reshape(2, 3)}
    detectors.write_detector(folder / "a.pt", detectors.Detector(**{**vars(DETECTOR), "state": state}))
    return folder / "a.pt"


def sound_detector(found: Any) -> None:
    assert isinstance(found.model, str)
    assert isinstance(found.state, dict)
    assert all(hasattr(value, "shape") for value in found.state.values())


def make_fit(folder: Path) -> Path:
    materials.write_materials(folder / "fit", TERRAIN, FITTED)
    return folder / "fit"


def make_model(folder: Path) -> Path:
    colmap.write_model(folder / "model", {"A": LOCALISED}, points=np.array([[0.0, 0, 0], [1, 0, 0]]))
    return folder / "model"


def sound_all(found: dict[str, LocalisedRig]) -> None:
    for one in found.values():
        sound_localised(one)


def imported(source: Path) -> dict[PhotoKey, Any]:
    out = source.parent / f"{source.name}.out"
    shutil.rmtree(out, ignore_errors=True)
    import_labels.import_labels(source, out)
    try:
        return {PhotoKey.parse(path.stem): yolo.read_boxes(path) for path in out.glob("*.txt")}
    finally:
        shutil.rmtree(out)


def sound_import(found: dict[PhotoKey, Any]) -> None:
    assert found
    for one in found.values():
        own_boxes(one)


class _Options(yaml_files.BaseModel, extra="forbid"):
    run: str
    seed: int = 0
    lamps: dict[str, list[float]] | None = None


YAML = "run: demo\nseed: 3\nlamps: {a: [1.0, 2, 3], b: &b [4, 5]}\n"
_SMALL = (16, 12)


# Cases by function with module; every reader has at least one case.
def make_geotiff(folder: Path) -> Path:
    import rasterio

    path = folder / "a.tif"
    place = {"crs": "EPSG:32633", "transform": rasterio.Affine(1.0, 0, 500_000.0, 0, -1.0, 4_000_000.0)}
    shape = {"width": 8, "height": 8, "count": 1, "dtype": "float32"}
    with rasterio.open(path, "w", driver="GTiff", **shape, **place) as made:
        made.write(np.arange(64, dtype=np.float32).reshape(8, 8), 1)
    return path


CASES: dict[str, list[Case]] = {
    "formats.bags.bag_metadata": [Case(make_bag, lambda path: bags.bag_metadata(path, "a.mcap"))],
    "run_files.best_photos.read_resized": [
        Case(
            content("a.png", PHOTO),
            lambda path: best_photos.read_resized(path, RIG.left),
            same(np.zeros(RIG.left.shape, np.float32)),
        ),
    ],
    "run_files.best_photos.read_all_resized": [
        Case(
            content("a.png", PHOTO),
            lambda path: best_photos.read_all_resized({("A", "L"): {"30": path}}, {"A": LOCALISED}, 0.02),
        ),
    ],
    "run_files.class_masks.read_class_mask": [
        Case(file("a.png", class_masks.write_class_mask, CLASS_MASK), class_masks.read_class_mask, same(CLASS_MASK)),
    ],
    "formats.coco.read_coco_images": [
        Case(
            file("a.json", coco.write_coco, LABELS),
            coco.read_coco_images,
            lambda found: sound_coco(  # names of images may be any text
                {PhotoKey.parse("01_A_off_30_L_0256"): [row.annotation for _, _, rows in found for row in rows]}
            ),
        ),
    ],
    "formats.coco.read_coco": [
        Case(file("a.json", coco.write_coco, LABELS), coco.read_coco, sound_coco),
        Case(file("a.json", coco.write_coco, LABELS, 0.5), coco.read_coco, sound_coco),
    ],
    "formats.files.read_json": [
        Case(text("a.json", json.dumps({"a": [1, 2.5, None], "b": {"c": "d"}})), files.read_json)
    ],
    "formats.geotiff.read_elevation": [Case(make_geotiff, lambda path: geotiff.read_elevation(path, 2.0, 3.0))],
    "run_files.instances.read_instances": [
        Case(file("a.png", png.write_png, IDS), instances.read_instances, same(IDS))
    ],
    "run_files.instances.read_kind_masks": [
        Case(
            file("a.png", png.write_png, IDS),
            instances.read_kind_masks,
            lambda found: same(IDS >= instances.SHADOW_IDS)(found["shadow"]),
        ),
    ],
    "run_files.inventory.read_inventory": [
        Case(file("a.json", inventory.write_inventory, INVENTORY), inventory.read_inventory, sound_inventory),
    ],
    "run_files.lamps.read_suns": [
        Case(
            the_folder(file(lamps.FILE, lambda path, suns: lamps.write_suns(path.parent, suns), {"30": POINTS[0, 0]})),
            lambda folder: lamps.read_suns(folder, {"A": LOCALISED}),
            lambda found: [_shape(found[sun], (3,)) for sun in SUNS],
        ),
    ],
    "run_files.lamps.read_localised_suns": [
        Case(
            the_folder(file(lamps.FILE, lambda path, suns: lamps.write_suns(path.parent, suns), {"30": POINTS[0, 0]})),
            lamps.read_localised_suns,
            lambda found: [_shape(one, (3,)) for one in found.values()],
        ),
    ],
    "run_files.materials.read_materials": [
        Case(
            make_fit,
            lambda folder: materials.read_materials(folder, TERRAIN),
            lambda found: [_shape(one.albedo, (8,)) for one in found.models.values()],
            "fit/*",
        ),
    ],
    "formats.nasa.read_calibration": [
        Case(file("stereo.calibration", nasa.write_calibration, default_rig()), nasa.read_calibration, sound_rig),
    ],
    "formats.nasa.read_range_map": [
        Case(
            file("PosA_org-XYZ.tif", nasa.write_range_map, POINTS[:12, :16]),
            lambda path: np.nan_to_num(nasa.read_range_map(path, _SMALL)),
            lambda found: _shape(found, (12, 16, 3)),
        ),
    ],
    "formats.nasa.read_cloud": [
        Case(file("PosA.xyz", nasa.write_cloud, POINTS[0], np.arange(len(POINTS[0]))), nasa.read_cloud, sound_cloud),
        Case(file("PosA.ply", ply.write_ply, ply.Cloud(POINTS[0], POINTS[0])), nasa.read_cloud, sound_cloud),
    ],
    "formats.npz.read_arrays": [
        Case(
            file("a.npz", npz.write_arrays, packed, level=POINTS[0], digest=np.str_("ab")),
            lambda path: npz.read_arrays(path, ("level", "digest")),
            lambda found: same(POINTS[0])(found["level"]),
        )
        for packed in (True, False)
    ],
    "formats.obj.read_obj": [
        Case(file("terrain01_rock3.obj", obj.write_obj, TETRAHEDRON, "rock"), obj.read_obj, sound_mesh),
        Case(
            text("a.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nv 1 1 0\nf 1/1 2/1 4/1 3/1\nf -1 -2 -3\n"),
            obj.read_obj,
            sound_mesh,
        ),
    ],
    "formats.ply.read_ply": [
        Case(
            file("a.ply", ply.write_ply, ply.Cloud(POINTS[0], POINTS[0])),
            ply.read_ply,
            lambda found: sound_cloud(found.points),
        ),
    ],
    "formats.png.read_png": [
        Case(file("a.png", png.write_png, PIXELS), png.read_png, same(PIXELS)),
        Case(
            file("a.png", png.write_png, np.dstack([PIXELS] * 3).astype(np.uint8)),
            png.read_png,
            lambda found: _shape(found, (12, 16, 3)),
        ),
    ],
    "formats.png.size": [
        Case(content(name, cv2.imencode(name[1:], PIXELS // divisor)[1].tobytes()), png.size, positive_size)
        for name, divisor in (("a.png", 1), ("a.tif", 1), ("a.jpg", 16), ("a.webp", 16), ("a.bmp", 16))
    ],
    "formats.png.read_photo": [
        Case(file("a.png", png.write_png, PIXELS), lambda path: png.read_photo(path, _SMALL), same(PIXELS))
    ],
    "formats.png.parse_header": [
        Case(
            file("a.png", png.write_png, PIXELS),
            lambda path: png.parse_header(path.read_bytes()),
            named=False,
            check=lambda found: same(np.array([16, 12, 16, 1, 1]))(np.array(list(vars(found).values()))),
        ),
    ],
    "formats.release.read_annotated_boxes": [
        Case(
            the_folder(text(f"{KEY}.txt", YOLO_BOXES), text(yolo.CLASS_FILE, "rock\nshadow\n")),
            release.read_annotated_boxes,
            lambda found: [own_boxes(one) for one in found.values()],
        ),
    ],
    "run_files.rigs.read_rig": [
        Case(file("calibration.json", rigs.write_rig, default_rig(), "stated"), rigs.read_rig, sound_rig)
    ],
    "run_files.rigs.read_localised": [
        Case(file("PosA.json", rigs.write_localised, LOCALISED), rigs.read_localised, sound_localised),
    ],
    "run_files.rigs.read_all_localised": [
        Case(the_folder(file("PosA.json", rigs.write_localised, LOCALISED)), rigs.read_all_localised, sound_all),
    ],
    "formats.rle.from_text": [
        Case(
            text("a.txt", MASK.counts),
            lambda path: rle.from_text(path.read_text("latin-1")).mask(),
            named=False,
            check=lambda found: _shape(found, (HEIGHT, WIDTH)),
        ),
    ],
    "formats.rle.from_runs": [
        Case(
            text("a.txt", "\x0a\x14\x1e\x28"),
            named=False,
            read=lambda path: rle.from_runs([*path.read_bytes()][:4], (10, 10)).mask(),
            check=lambda found: _shape(found, (10, 10)),
        ),
    ],
    "run_files.rock_translations.read_translations": [
        Case(
            the_folder(
                text(
                    rock_translations.FILE,
                    ",".join(rock_translations.COLUMNS) + "\n3,1.5,2,3,4,5,6,7\n4,1.5,2,3,4,5,6,7\n",
                )
            ),
            rock_translations.read_translations,
            lambda found: [_shape(one, (3,)) for one in found.values()],
        ),
    ],
    "run_files.pictures.pictures_at": [
        Case(
            file("a.parquet", tables.write_parquet, pd.DataFrame({"key": [str(KEY)], "path": ["a/b.png"]})),
            run_files.pictures_at,
            lambda found: [_is(key, PhotoKey) for key in found],
        ),
    ],
    "run_files.pictures.cover_photo": [
        Case(
            file("a.json", inventory.write_inventory, INVENTORY),
            lambda path: run_files.cover_photo(path, "A"),
            lambda found: _is(found, Path | None),
        ),
    ],
    "run_files.scans.read_scan": [
        Case(
            the_folder(file("m.tif", nasa.write_range_map, POINTS)),
            check=lambda found: _shape(found, (len(found), 3)),
            read=lambda folder: scans.read_scan(
                inventory.Inventory(1, "polar", range_maps={"A": folder / "m.tif"}), "A", RIG
            ),
        ),
        Case(
            the_folder(file("m.xyz", nasa.write_cloud, POINTS[0], np.arange(len(POINTS[0])))),
            lambda folder: scans.read_scan(inventory.Inventory(1, "polar", clouds={"A": folder / "m.xyz"}), "A", RIG),
        ),
    ],
    "run_files.scene.read_terrain": [
        Case(
            the_folder(
                file(obj.ground_name(1), obj.write_obj, TETRAHEDRON, "ground"),
                file(obj.rock_name(1, 3), obj.write_obj, TETRAHEDRON, "rock"),
            ),
            lambda folder: scene.read_terrain(folder, 1),
            sound_mesh,
        ),
    ],
    "run_files.scene.mesh_origins": [
        Case(
            the_folder(
                text(scene.MESH_TABLE, "mesh,made_from\nterrain01_ground.obj,scan\nterrain01_rock3.obj,fitted\n")
            ),
            scene.mesh_origins,
            lambda found: [_is(word, str) for pair in found.items() for word in pair],
        ),
    ],
    "formats.tables.read_parquet": [
        Case(
            file("a.parquet", tables.write_parquet, MADE),
            lambda path: tables.read_parquet(path, tables.LABEL_COLUMNS),
            lambda found: found.to_dict(),
        ),
    ],
    "formats.tables.read_csv": [
        Case(
            file("a.csv", tables.write_csv, MADE),
            lambda path: tables.read_csv(path, tables.LABEL_COLUMNS),
            lambda found: found.to_dict(),
        ),
    ],
    "formats.text_fields.fields_of": [
        Case(text("a.txt", YOLO_BOXES), lambda path: text_fields.fields_of(path, "label file"))
    ],
    "formats.yaml_files.read_yaml": [Case(text("a.yaml", YAML), yaml_files.read_yaml)],
    "formats.yaml_files.read_model": [
        Case(
            text("a.yaml", YAML),
            lambda path: yaml_files.read_model(path, _Options, "the file"),
            lambda found: _is(found, _Options),
        ),
    ],
    "formats.yolo.read_boxes": [Case(text("a.txt", YOLO_BOXES), yolo.read_boxes, own_boxes)],
    "formats.yolo.read_detections": [
        Case(
            text("a.txt", YOLO_BOXES.replace("\n", " 0.5\n", 1)),
            lambda path: yolo.read_detections(path)[:2],
            sound_boxes,
        ),
    ],
    "formats.yolo.read_shapes": [
        Case(
            text("a.txt", YOLO_BOXES + YOLO_RING),
            yolo.read_shapes,
            lambda found: sound_boxes((np.zeros(len(found), int), np.array([one.box for one in found]).reshape(-1, 4))),
        ),
    ],
    "formats.yolo.find_classes": [
        Case(
            the_folder(text(name, content)),
            yolo.find_classes,
            lambda found: [_is(one, str) for one in found.names],
        )
        for name, content in (
            ("data.yaml", "names: {0: rock, 1: shadow}\n"),
            ("notes.json", '{"categories": [{"id": 0, "name": "rock"}]}'),
            ("obj.names", "rock\nshadow\n"),
        )
    ],
    "formats.yolo.class_names": [
        Case(
            the_folder(text(yolo.CLASS_FILE, "rock\nshadow\nghost\n")),
            yolo.class_names,
            lambda found: [_is(one, str) for one in found],
        ),
    ],
    "formats.yolo.read_polygons": [Case(text("a.txt", YOLO_RING * 2), yolo.read_polygons, sound_polygons)],
    "formats.yolo.has_polygons": [
        Case(text("a.txt", YOLO_RING * 2), yolo.has_polygons, lambda found: [_is(found, bool)])
    ],
    "formats.yolo.read_boxes_or_polygons": [
        Case(text("a.txt", YOLO_RING * 2), yolo.read_boxes_or_polygons, own_boxes),
        Case(text("a.txt", YOLO_BOXES), yolo.read_boxes_or_polygons, own_boxes),
    ],
    "formats.yolo.read_rock_boxes": [
        Case(
            the_folder(text(f"{KEY}.txt", YOLO_BOXES)),
            lambda folder: yolo.read_rock_boxes(folder, 1),
            lambda found: [_shape(one, (len(one), 4)) for own in found.values() for one in own],
        ),
    ],
    "acquire.archives.unpack": [Case(make_zip, unpacked, whole_zip, "a.zip")],
    "acquire.fetch.read_pins": [
        Case(
            the_folder(text(fetch.PINS, json.dumps({"a.zip": "0" * 64}))),
            fetch.read_pins,
            lambda found: [_is(word, str) for pair in found.items() for word in pair],
        ),
    ],
    "acquire.index.describe_photo": [
        Case(content("a.png", PHOTO), index.describe_photo, lambda found: _is(found["sha256"], str)),
    ],
    "annotate.import_labels.import_labels": [
        Case(file("a.json", coco.write_coco, LABELS), imported, sound_import),
        Case(text("a.xml", CVAT), imported, sound_import),
        Case(text("tasks.json", json.dumps(STUDIO)), imported, sound_import),
        Case(text("tasks.json", json.dumps(STUDIO_MIN)), imported, sound_import),
        Case(zipped_export, imported, sound_import, "export.zip"),
        Case(
            the_folder(text(f"export/{KEY}.txt", YOLO_BOXES), text("export/data.yaml", "names: [rock, shadow]\n")),
            lambda folder: imported(folder / "export"),
            sound_import,
            "export/*",
        ),
    ],
    "detect.detectors.files.read_detector": [Case(make_detector, detectors.read_detector, sound_detector)],
    "detect.detectors.files.load_tensors": [Case(make_detector, detectors.load_tensors)],
}


def _shape(array: np.ndarray, shape: tuple[int, ...]) -> None:
    assert array.shape == shape, f"{array.shape}, expected {shape}"


def _is(value: Any, kind: Any) -> None:
    assert isinstance(value, kind), f"{value!r} is no {kind}"


def is_refused(case: Case, source: Any) -> bool:
    """Read a damaged file; assert that the reader returns a sound object or raises one line that names the file."""
    try:
        found = case.read(source)
    except PolarsimError as error:
        refusal = error
    else:
        finite(found, case.missing)
        case.check(found)
        return False
    assert len(str(refusal).splitlines()) == 1, f"several lines: {str(refusal)!r}"
    assert not case.named or refusal.path is not None, f"no file: {refusal}"
    return True


@contextmanager
def valid(case: Case, folder: Path) -> Iterator[tuple[Any, dict[Path, bytes]]]:
    """Return the input of a case and the files to damage; check that the undamaged input is readable."""
    source = case.make(folder)
    case.check(case.read(source))
    yield source, {path: path.read_bytes() for path in sorted(folder.glob(case.harmed)) if path.is_file()}


def damaged_is_refused(case: Case, source: Any, path: Path, whole: bytes, damage: Damage) -> bool:
    """Damage a file, read it, restore it."""
    return _changed_is_refused(case, source, path, whole, damage.apply(whole))


def garbage_is_refused(case: Case, source: Any, path: Path, whole: bytes) -> bool:
    """Return whether zeros, bytes 0xff, or all bytes in turn are refused instead of the content of a file."""
    garbage = (bytes([0]), bytes([0xFF]), bytes(range(256)))
    contents = [each * (len(whole) // len(each) + 1) for each in garbage]
    return any(_changed_is_refused(case, source, path, whole, content) for content in contents)


def _changed_is_refused(case: Case, source: Any, path: Path, whole: bytes, changed: bytes) -> bool:
    _replace(path, changed)
    try:
        refused = is_refused(case, source)
        assert path.exists()
        return refused
    finally:
        _replace(path, whole)


def _replace(path: Path, content: bytes) -> None:
    """Replace a file instead of truncating it, which ext4 writes to the disk immediately; takes half of the time."""
    path.unlink()
    path.write_bytes(content)
