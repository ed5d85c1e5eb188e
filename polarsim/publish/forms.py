"""The forms in which a run is published: a module and an entry of `FORMS` each."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from polarsim.publish import (
    crate,
    croissant,
    detection_sets,
    huggingface,
    pds4,
    reconstruction,
    ros_bags,
    scenes,
    stereo_set,
    trajectories,
    weights,
)
from polarsim.publish.bundle import Bundle
from polarsim.publish.catalogue import Catalogue, Picture

Write = Callable[[Catalogue, Bundle], None]


def no_picture(_: Picture) -> int:
    """Bytes of a picture in a form that takes none along."""
    return 0


@dataclass(frozen=True)
class Form:
    """A form in which a run leaves."""

    description: str  # of its folder, for the data card
    write: Write
    bytes_of: Callable[[Picture], int]  # about, of one picture
    needs: tuple[str, ...] = ()  # packages that it imports beyond the core's
    front: Callable[[Catalogue], str] = lambda _: ""  # what stands before the card
    fixed: Callable[[Catalogue], int] = lambda _: 0  # bytes, about, of what is no picture of a station
    unavailable: Callable[[Catalogue], str] = lambda _: ""  # why the run cannot have the form; empty: it can
    by_part: bool = False  # pictures in no part of the run's split are left out


def _mesh_bytes(catalogue: Catalogue) -> int:
    return sum(path.stat().st_size for one in catalogue.terrains.values() for path in one.meshes.values())


def _no_mesh(catalogue: Catalogue) -> str:
    return "" if any(one.meshes for one in catalogue.terrains.values()) else "the run has no meshes"


def _no_drive(catalogue: Catalogue) -> str:
    return "" if catalogue.drives else "the run has no drive (rover.run in its configuration)"


FORMS: dict[str, Form] = {
    "croissant": Form(
        f"`{croissant.FILE}` describes tables (Parquet) and pictures (16-bit PNG below `pictures/<domain>/`) in "
        "Croissant 1.1 with RAI fields, `geocroissant.json` with the frame too. "
        "Read the tables with `mlcroissant`, the pictures by file.",
        croissant.write, croissant.bytes_of, croissant.NEEDS,
    ),
    "hf": Form(
        "A folder for Hugging Face's `datasets`: a configuration a domain, `<domain>/<split>/KEY.png` with 16 bits, "
        "`ids/KEY.png` (1000 + k: rock k, 2000 + k: its shadow; 65534, 65535: of a rock without a number), and "
        "`metadata.parquet` with key, pose, lens and objects (bbox x y w h, category 0 rock 1 shadow, masks as COCO "
        "runs). `load_dataset(FOLDER, DOMAIN)` reads it.",
        huggingface.write_folder, huggingface.bytes_of, front=lambda one: huggingface.front(one, parquet=False),
        by_part=True,
    ),
    "parquet": Form(
        "The same as `hf` in Parquet files that hold the pictures' own bytes: `load_dataset(FOLDER, DOMAIN)`.",
        huggingface.write_parquet, huggingface.bytes_of, front=lambda one: huggingface.front(one, parquet=True),
        by_part=True,
    ),
    "coco": Form(
        "`images/<domain>/KEY.png` with 16 bits and `annotations/<domain>_<part>.json`: boxes, visible masks as runs "
        "and, of twins, amodal masks (`amodal_segmentation`, `amodal_bbox`, `visible_share`); a shadow names the "
        "annotation of its rock in `shadow_of`. `pycocotools` reads it.",
        detection_sets.write_coco, detection_sets.coco_bytes, by_part=True,
    ),
    "yolo": Form(
        "A data set a domain for YOLO trainers: `<domain>.yaml`, `<domain>/images/<part>/KEY.png` with 8 bits (by the "
        "curve that the run's own detectors are trained with, `detect.pictures`), `<domain>/labels/<part>/KEY.txt` "
        "(0 rock, 1 shadow).",
        detection_sets.write_yolo, detection_sets.yolo_bytes, by_part=True,
    ),
    "kitti": Form(
        "A data set a domain as KITTI's devkit expects it: rectified pairs (8 bits, `training/image_2` left, "
        "`image_3` right), `calib`, `label_2` (Rock, Shadow; boxes in three dimensions are not known), `disp_noc_0` "
        "and `disp_occ_0` (disparity of the meshes, 256 a pixel; 0 where there is none or where it is 256 px and "
        "more), `ImageSets`, and `keys.csv`, which names the photo keys. In `calib` the laser's frame is the sandbox.",
        stereo_set.write, stereo_set.bytes_of, by_part=True,
    ),
    "colmap": Form(
        "A COLMAP model a domain and terrain: `images/KEY.png` (8 bits), `sparse/0/*.txt` with lenses, the rig, poses "
        "in the sandbox frame, and points drawn over the meshes. The light changes from picture to picture: "
        "`--subset azimuth=180,light=off` gives one light.",
        reconstruction.write_colmap, reconstruction.bytes_of,
    ),
    "nerfstudio": Form(
        "A folder a domain and terrain for nerfstudio and its splats: `images/KEY.png` (8 bits), `transforms.json`, "
        "`points.ply` drawn over the meshes. `--subset azimuth=180,light=off` gives one light.",
        reconstruction.write_nerfstudio, reconstruction.bytes_of,
    ),
    "pds4": Form(
        "A PDS4 bundle, `bundle.xml`: collections of pictures (`data_<domain>`) and of maps of ids (`ids_<domain>`) as "
        "raw arrays, of browse pictures, tables, maps and documents; a label beside every file states types, units, "
        "frames, and whether values were measured, fitted or are synthetic. `pds4_tools` reads it. It was not "
        "validated by the PDS.",
        pds4.write, pds4.bytes_of,
    ),
    "ro-crate": Form(
        f"An RO-Crate, `{crate.FILE}`: pictures, what made each twin, tables, meshes, poses, the workflow's files, and "
        "the run as the action that made them. `rocrate` reads it.",
        crate.write, crate.bytes_of, crate.NEEDS, fixed=_mesh_bytes,
    ),
    "gltf": Form(
        "`terrainNN.glb`: ground and rocks as named nodes with rock ids (`extras`), cameras (principal point and "
        "distortion in `extras`) and lamps; metres, +Y up. No pictures.",
        scenes.write_gltf, no_picture, fixed=_mesh_bytes, unavailable=_no_mesh,
    ),
    "usd": Form(
        "`terrainNN.usdc`: ground and rocks with semantic labels (`class`, `rock_id`), cameras with apertures, "
        "principal point and distortion (`polarsim:*`), lamps; metres, +Z up. No pictures.",
        scenes.write_usd, no_picture, scenes.USD_NEEDS, fixed=_mesh_bytes, unavailable=_no_mesh,
    ),
    "mcap": Form(
        "Bags for ROS 2, each a folder with `metadata.yaml`: `drives/seedN` as the rover's run wrote them, and "
        "`stations/<domain>/TerrainNN_PosX` with pictures (16-bit PNG), camera_info, labels and keys of both cameras, "
        "a second apart, for NASA noted no times.",
        ros_bags.write, ros_bags.bytes_of, ros_bags.NEEDS, fixed=ros_bags.fixed_bytes,
    ),
    "euroc": Form(
        "The rover's drives as EuRoC's `mav0` folders: pictures of cameras that are fixed to the rover, an IMU without "
        "noise, exact states. Everything is synthetic.",
        trajectories.write_euroc, no_picture, fixed=trajectories.fixed_bytes, unavailable=_no_drive,
    ),
    "tum": Form(
        "The rover's drives as TUM's folders: `rgb/`, `rgb.txt` and `groundtruth.txt`, poses of the camera in the "
        "world. Everything is synthetic.",
        trajectories.write_tum, no_picture, fixed=trajectories.fixed_bytes, unavailable=_no_drive,
    ),
    "detectors": Form(
        "The run's detectors: `<split>/seedN/<domain>.pt`, tensors and plain values in PyTorch's format, and beside "
        "each `<domain>.md`, a card with its training and its scores. `polarsim detect --weights` uses them.",
        weights.write, no_picture, fixed=weights.fixed_bytes, unavailable=weights.lacking,
    ),
}  # fmt: skip
