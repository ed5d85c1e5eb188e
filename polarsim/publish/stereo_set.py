"""A KITTI data set a domain: rectified pairs with calibration, boxes and disparity, laid out as the devkit expects."""

from __future__ import annotations

import csv
import io
from functools import partial
from pathlib import Path

import numpy as np

from polarsim.detect.stereo.rectify import Rectification, rectify
from polarsim.detect.stereo.truth import DepthTruth, depth_truth
from polarsim.detect.tone import to_8_bits
from polarsim.formats import kitti, png
from polarsim.formats.coco import Annotation
from polarsim.geometry.boxes import around
from polarsim.geometry.lens import Lens
from polarsim.geometry.poses import Pose
from polarsim.geometry.rays_embree import EmbreeCaster
from polarsim.geometry.stereo import StereoRig
from polarsim.publish.bundle import Bundle
from polarsim.publish.catalogue import Catalogue, Picture
from polarsim.publish.detection_sets import PARTS
from polarsim.run_files.scene import read_terrain

_SEEN, _HARDLY = 0.98, 0.5  # visible shares from which a thing is seen whole, below which it is hardly seen
DISPARITIES = ("disp_noc_0", "disp_occ_0")  # of pixels that the right camera sees too, and of all
_STEP_PX = 2.0  # between points of a box's edge that are turned


def bytes_of(picture: Picture) -> int:
    return 2 * picture.width * picture.height + 2000  # 8 bits, and of every pair two pictures of disparity


def write(catalogue: Catalogue, bundle: Bundle) -> None:
    """`<domain>/training/{image_2,image_3,label_2,calib,disp_noc_0,disp_occ_0}/NNNNNN.*`, `ImageSets/`, `keys.csv`."""
    disparities = Disparities(catalogue)
    for domain in catalogue.domains:
        pairs = _pairs(catalogue, domain)
        names: dict[str, list[str]] = {}
        table = io.StringIO()
        rows = csv.writer(table, lineterminator="\n")
        rows.writerow(["name", "left", "right", "part", "origin"])
        rigs: dict[tuple[int, str], Rectification] = {}  # pairs of a station share theirs
        for number, (left, right) in enumerate(pairs):
            name, part = f"{number:06d}", PARTS[left.part]
            names.setdefault(part, []).append(name)
            rows.writerow([name, left.key, right.key, part, catalogue.picture_origin(left)])
            if left.key.station not in rigs:
                own = catalogue.terrains[left.key.terrain].rigs[left.key.position].rig
                rigs = {left.key.station: rectify(own, left.width / own.left.width)}
            target = (f"{domain}/training", name)
            _write_pair(catalogue, bundle, target, (left, right), rigs[left.key.station])
            if meshes := list(catalogue.terrains[left.key.terrain].meshes.values()):
                for kind in DISPARITIES:
                    file = f"{domain}/training/{kind}/{name}.png"
                    content = partial(disparities.write, left.key.station, rigs[left.key.station], kind)
                    bundle.make(file, content, [*meshes, catalogue.camera_file(left)])
        for part, listed in names.items():
            bundle.text(f"{domain}/ImageSets/{part}.txt", "".join(f"{name}\n" for name in listed))
        bundle.text(f"{domain}/keys.csv", table.getvalue())


class Disparities:
    """Pictures of disparity by station, from its meshes: the same for every light, domain and exposure."""

    def __init__(self, catalogue: Catalogue) -> None:
        self._catalogue = catalogue
        self._pngs: dict[tuple[int, str], dict[str, bytes]] = {}  # of the last station: pairs come one after another

    def write(self, station: tuple[int, str], rig: Rectification, kind: str, path: Path) -> None:
        if station not in self._pngs:
            truth = self._truth(station, rig)
            disparity = rig.disparity(truth.depth)
            pictures = zip(DISPARITIES, (np.where(truth.shared, disparity, np.nan), disparity), strict=True)
            self._pngs = {station: {name: png.encode(kitti.disparity_picture(one)) for name, one in pictures}}
        path.write_bytes(self._pngs[station][kind])

    def _truth(self, station: tuple[int, str], rig: Rectification) -> DepthTruth:
        terrain, position = station
        mesh = read_terrain(self._catalogue.run / "meshes" / f"Terrain{terrain:02d}", terrain)
        caster = EmbreeCaster(mesh.vertices, mesh.faces)
        return depth_truth(mesh, caster, self._catalogue.terrains[terrain].rigs[position], rig)


def _pairs(catalogue: Catalogue, domain: str) -> list[tuple[Picture, Picture]]:
    """Left and right pictures of one moment, of positions that are localised."""
    by_key = {one.key: one for one in catalogue.of_domain(domain)}
    return [
        (one, by_key[key.other_camera])
        for key, one in by_key.items()
        if key.camera == "L" and key.other_camera in by_key and catalogue.camera(one)
    ]


def _write_pair(
    catalogue: Catalogue, bundle: Bundle, target: tuple[str, str], pair: tuple[Picture, Picture], rig: Rectification
) -> None:
    (folder, name), (left, right) = target, pair
    localised, sources = catalogue.terrains[left.key.terrain].rigs[left.key.position], catalogue.sources(left)
    for side, one, maps in (("image_2", left, rig.left_maps), ("image_3", right, rig.right_maps)):
        bundle.png(f"{folder}/{side}/{name}.png", partial(_turned, one, maps), [*sources, one.path])
    objects = [kitti_object(one, localised.rig, rig, left) for one in catalogue.labels(left)]
    own = [one for one in objects if one]
    bundle.make(f"{folder}/label_2/{name}.txt", partial(kitti.write_objects, objects=own))
    matrices = calibration(rig, localised.sandbox_from_left)
    bundle.make(f"{folder}/calib/{name}.txt", partial(kitti.write_calibration, matrices=matrices))


def calibration(rig: Rectification, sandbox_from_left: Pose) -> dict[str, np.ndarray]:
    """KITTI's matrices; its laser's frame is our sandbox, so points of the sandbox are projected as its laser's are."""
    left = np.hstack([rig.lens.opencv_matrix(), np.zeros((3, 1))])
    right = left.copy()
    right[0, 3] = -rig.lens.fx * rig.baseline
    rectified_from_sandbox = (sandbox_from_left @ rig.left_from_rectified).inverse().matrix[:3]
    one = {"P0": left, "P1": right, "P2": left, "P3": right, "R0_rect": np.eye(3)}
    return {**one, "Tr_velo_to_cam": rectified_from_sandbox, "Tr_imu_to_velo": np.eye(4)[:3]}


def kitti_object(label: Annotation, rig: StereoRig, turned: Rectification, left: Picture) -> kitti.KittiObject | None:
    """The label in the rectified picture; None where nothing of it is in there."""
    whole = around(rectified_edges(label.box, rig.left.scaled(left.width / rig.left.width), turned))
    box = np.clip(whole, 0, [left.width, left.height] * 2)
    if (box[2:] - box[:2] < 1e-2).any():
        return None
    inside = float(np.prod(box[2:] - box[:2]) / np.prod(whole[2:] - whole[:2]))
    share = label.visible_share
    occluded = 3 if label.amodal is None else 0 if share >= _SEEN else 1 if share >= _HARDLY else 2
    return kitti.KittiObject(label.kind.capitalize(), box, round(1 - inside, 2), occluded)


def rectified_edges(box: np.ndarray, lens: Lens, turned: Rectification) -> np.ndarray:
    """(n, 2) points along the edges of a box of the picture, in the rectified one: straight edges bend."""
    x0, y0, x1, y1 = box
    across = np.linspace(x0, x1, max(2, int((x1 - x0) / _STEP_PX) + 2))
    down = np.linspace(y0, y1, max(2, int((y1 - y0) / _STEP_PX) + 2))
    edges = [(across, np.full_like(across, y)) for y in (y0, y1)] + [(np.full_like(down, x), down) for x in (x0, x1)]
    points = np.concatenate([np.stack(edge, axis=1) for edge in edges])
    return turned.lens.project(turned.left_from_rectified.inverse().apply(lens.directions(points)))


def _turned(picture: Picture, maps: tuple[np.ndarray, np.ndarray]) -> np.ndarray:
    import cv2

    bent = cv2.remap(png.read(picture.path), *maps, cv2.INTER_LINEAR)
    return to_8_bits(np.asarray(bent))
