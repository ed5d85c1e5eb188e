"""Registry of the published formats; each format is a module and an entry of `FORMS`."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import NamedTuple

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
from polarsim.publish.catalogue import Catalogue, CatalogueImage


class ImageSize(NamedTuple):
    """Approximate size of an image and its metadata in a format."""

    copied: bool  # the 16-bit file is copied
    per_pixel: int  # bytes of other files: 8-bit images, whose noise is hardly compressible, and maps
    metadata: int  # bytes

    def of(self, picture: CatalogueImage) -> int:
        file = picture.path.stat().st_size if self.copied else 0
        return file + self.per_pixel * picture.width * picture.height + self.metadata


NO_IMAGES = ImageSize(False, 0, 0)


@dataclass(frozen=True)
class Form:
    """A published format."""

    description: str  # of the folder, for the data card
    write: Callable[[Catalogue, Bundle], None]
    image: ImageSize = NO_IMAGES
    needs: tuple[str, ...] = ()  # optional packages
    front: Callable[[Catalogue], str] = lambda _: ""  # front matter of the data card
    files: Callable[[Catalogue], Iterable[Path]] = lambda _: ()  # other files of the run, for the size of the format
    unavailable: Callable[[Catalogue], str] = lambda _: ""  # reason why the run lacks required data; empty if complete
    by_part: bool = False  # images in no part of the run's split are excluded


def _meshes(catalogue: Catalogue) -> list[Path]:
    return [path for terrain in catalogue.terrains.values() for path in terrain.meshes.values()]


def _no_mesh(catalogue: Catalogue) -> str:
    return "" if _meshes(catalogue) else "the run has no meshes"


def _no_stereo(catalogue: Catalogue) -> str:
    return "" if catalogue.site.cameras.stereo else f"the site {catalogue.site.name} has a single camera"


def _no_drive(catalogue: Catalogue) -> str:
    return "" if catalogue.drives else "the run has no drive (rover.run in its configuration)"


def _no_sequence(catalogue: Catalogue) -> str:
    return _no_drive(catalogue) or trajectories.without_sensors(catalogue)


def _no_detector(catalogue: Catalogue) -> str:
    return "" if any(weights.detectors(catalogue)) else "the run has no detectors (target `detect`)"


FORMS: dict[str, Form] = {
    "croissant": Form(
        f"`{croissant.FILE}` describes tables (Parquet) and images (16-bit PNG below `pictures/<domain>/`) in "
        "Croissant 1.1 with RAI fields; `geocroissant.json` adds the coordinate system. "
        "Read the tables with `mlcroissant` and the images as files.",
        croissant.write_croissant, ImageSize(True, 0, 4000), ("mlcroissant",),
    ),
    "hf": Form(
        "Folder for Hugging Face's `datasets`, a configuration per domain: `<domain>/<split>/KEY.png` with 16 bits, "
        "`ids/KEY.png` (1000 + k: rock k, 2000 + k: shadow of rock k; 65534, 65535: rock or shadow without id), and "
        "`metadata.parquet` with key, pose, lens and objects (bbox x y w h, category 0 rock 1 shadow, masks as COCO "
        "RLE). Read it with `load_dataset(FOLDER, DOMAIN)`.",
        huggingface.write_folder, ImageSize(True, 0, 40_000),
        front=partial(huggingface.front, parquet=False), by_part=True,
    ),
    "parquet": Form(
        "Content of `hf` in Parquet files that include the images. Read it with `load_dataset(FOLDER, DOMAIN)`.",
        huggingface.write_parquet_folder, ImageSize(True, 0, 40_000),
        front=partial(huggingface.front, parquet=True), by_part=True,
    ),
    "coco": Form(
        "`images/<domain>/KEY.png` with 16 bits and `annotations/<domain>_<part>.json`: boxes, visible masks (RLE) "
        "and, for twins, amodal masks (`amodal_segmentation`, `amodal_bbox`, `visible_share`); `shadow_of` is the id "
        "of the rock annotation that casts a shadow. Readable by `pycocotools`.",
        detection_sets.write_coco_set, ImageSize(True, 0, 20_000), by_part=True,
    ),
    "yolo": Form(
        "A data set per domain for YOLO trainers: `<domain>.yaml`, `<domain>/images/<part>/KEY.png` with 8 bits (tone "
        "curve of the run's detectors, `detect.pictures`), `<domain>/labels/<part>/KEY.txt` (0 rock, 1 shadow).",
        detection_sets.write_yolo, ImageSize(False, 1, 2000), by_part=True,
    ),
    "kitti": Form(
        "A data set per domain in the layout of KITTI's devkit: rectified pairs (8 bits, `training/image_2` left, "
        "`image_3` right), `calib`, `label_2` (Rock, Shadow; without 3D boxes), `disp_noc_0` and `disp_occ_0` "
        "(disparity of the meshes in 1/256 px; 0 for no disparity or 256 px and more), `ImageSets`, and `keys.csv` "
        "with the photo keys. The laser frame in `calib` is the sandbox frame.",
        stereo_set.write_kitti, ImageSize(False, 2, 2000), unavailable=_no_stereo, by_part=True,
    ),
    "colmap": Form(
        "A COLMAP model per domain and terrain: `images/KEY.png` (8 bits), `sparse/0/*.txt` with lenses, the rig, "
        "poses in the sandbox frame, and points sampled on the meshes. The light varies between images; "
        "`--subset azimuth=180,light=off` selects a single light.",
        reconstruction.write_colmap, ImageSize(False, 1, 2000),
    ),
    "nerfstudio": Form(
        "A folder per domain and terrain for nerfstudio and Gaussian splatting: `images/KEY.png` (8 bits), "
        "`transforms.json`, `points.ply` sampled on the meshes. `--subset azimuth=180,light=off` selects a single "
        "light.",
        reconstruction.write_nerfstudio, ImageSize(False, 1, 2000),
    ),
    "pds4": Form(
        "PDS4 bundle, `bundle.xml`: collections of images (`data_<domain>`) and instance maps (`ids_<domain>`) as raw "
        "arrays, browse images, tables, maps and documents. The XML label of each file states types, units, frames, "
        "and the origin of values (measured, fitted or synthetic). Readable by `pds4_tools`; not validated by the PDS.",
        pds4.write_pds4, ImageSize(False, 5, 8000),
    ),
    "ro-crate": Form(
        f"RO-Crate, `{crate.FILE}`: images, render settings of each twin, tables, meshes, poses, workflow files, and "
        "the run as the action that created them. Readable by `rocrate`.",
        crate.write_crate, ImageSize(True, 0, 8000), ("rocrate",), files=_meshes,
    ),
    "gltf": Form(
        "`terrainNN.glb`: ground and rocks as named nodes with rock ids (`extras`), cameras (principal point and "
        "distortion in `extras`) and lamps; metres, +Y up. No images.",
        scenes.write_gltf, files=_meshes, unavailable=_no_mesh,
    ),
    "usd": Form(
        "`terrainNN.usdc`: ground and rocks with semantic labels (`class`, `rock_id`), cameras with apertures, "
        "principal point and distortion (`polarsim:*`), lamps; metres, +Z up. No images.",
        scenes.write_usd, needs=("pxr",), files=_meshes, unavailable=_no_mesh,
    ),
    "mcap": Form(
        "ROS 2 bags, each a folder with `metadata.yaml`: `drives/seedN` with the rover's drives, and "
        "`stations/<domain>/TerrainNN_PosX` with images (16-bit PNG), camera_info, labels and keys of both cameras, "
        "at intervals of 1 s, since NASA's photos have no times.",
        ros_bags.write_bags, ImageSize(True, 0, 4000), ("mcap", "mcap_ros2", "rosbags"),
        files=lambda catalogue: ros_bags.drive_bags(catalogue).values(),
    ),
    "euroc": Form(
        "The rover's drives as EuRoC `mav0` folders, one per drive and light: images with calibration (`cam0` and "
        "`cam1` are the stereo pair, if the run has one), `imu0` and wheel encoders (`wheels0`) with the errors of "
        "sensors, exact states; estimates of the run as TUM trajectories of the rover in `estimates/`, with their "
        f"errors in `{trajectories.BASELINES}`. All data are synthetic.",
        trajectories.write_euroc, files=trajectories.drive_files, unavailable=_no_sequence,
    ),
    "tum": Form(
        "The rover's drives as TUM folders, one per drive, light and camera: `rgb/`, `rgb.txt`, `groundtruth.txt` with "
        "poses of the camera in the world frame, and a file of poses for each estimator of the run, with the errors "
        f"in `{trajectories.BASELINES}`. All data are synthetic.",
        trajectories.write_tum, files=trajectories.drive_files, unavailable=_no_sequence,
    ),
    "detectors": Form(
        "The run's detectors: `<split>/seedN/<domain>.pt`, tensors and plain values in PyTorch's format, and "
        "`<domain>.md`, a model card with training and scores. Use them with `polarsim detect --weights`.",
        weights.write_detectors, unavailable=_no_detector,
        files=lambda catalogue: (detector.path for detector in weights.detectors(catalogue)),
    ),
}  # fmt: skip
