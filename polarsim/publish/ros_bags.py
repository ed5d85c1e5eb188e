"""ROS 2 bags of the rover's drives and of the images of each station; each folder is a rosbag2 with `metadata.yaml`.

NASA's photos have no times. The images of a station are stamped at intervals of 1 s in the order of keys; both images
of a stereo pair have the same stamp.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np

from polarsim.formats import bags, ros
from polarsim.formats.ros import Stamped
from polarsim.geometry.poses import Pose
from polarsim.photo import Terrain, terrain_text
from polarsim.publish.bundle import Bundle
from polarsim.publish.catalogue import Catalogue, CatalogueImage
from polarsim.schemas.photos import BOX

SIDES = {"L": "left", "R": "right"}
SECOND = 1_000_000_000  # ns; also the first stamp, since 0 means `the latest` in tf2


def write_bags(catalogue: Catalogue, bundle: Bundle) -> None:
    """Write `drives/seedN/` and `stations/<domain>/TerrainNN_PosX/`."""
    for name, path in drive_bags(catalogue).items():
        folder = f"drives/{name}"
        copied = bundle.copy(f"{folder}/{name}.mcap", path)
        bundle.text(f"{folder}/{bags.METADATA}", bags.bag_metadata(copied, f"{name}.mcap"))
    for (domain, terrain, position), pictures in _stations(catalogue).items():
        name = f"Terrain{terrain_text(terrain)}_Pos{position}"
        folder = f"stations/{domain}/{name}"
        sources = [path for picture in pictures for path in catalogue.sources(picture)]
        bag = bundle.make(f"{folder}/{name}.mcap", partial(_write_station, catalogue, pictures), sources)
        bundle.text(f"{folder}/{bags.METADATA}", bags.bag_metadata(bag, f"{name}.mcap"))


def drive_bags(catalogue: Catalogue) -> dict[str, Path]:
    return {folder.name: folder / "drive.mcap" for folder in catalogue.drives if (folder / "drive.mcap").is_file()}


def _stations(catalogue: Catalogue) -> dict[tuple[str, Terrain, str], list[CatalogueImage]]:
    """Return the images of localised positions by domain, terrain and position."""
    stations: dict[tuple[str, Terrain, str], list[CatalogueImage]] = {}
    for picture in catalogue.pictures:
        if catalogue.camera(picture):
            stations.setdefault((picture.domain, *picture.key.station), []).append(picture)
    return stations


def _write_station(catalogue: Catalogue, pictures: list[CatalogueImage], path: Path) -> None:
    bags.write_mcap_bag(path, [stream(catalogue, pictures)])


def stream(catalogue: Catalogue, pictures: list[CatalogueImage]) -> Iterator[Stamped]:
    """Yield the messages of a station in the order of stamps."""
    localised = catalogue.terrains[pictures[0].key.terrain].rigs[pictures[0].key.position]
    yield (
        SECOND,
        "/tf_static",
        "tf2_msgs/msg/TFMessage",
        {
            "transforms": [
                *(
                    ros.transform(SECOND, "map", f"{SIDES[side]}_optical", localised.sandbox_from(side))
                    for side in localised.rig.sides
                ),
                *(
                    ros.transform(SECOND, "map", f"sun_{azimuth}", Pose(np.eye(3), position))
                    for azimuth, position in catalogue.terrains[pictures[0].key.terrain].suns.items()
                ),
            ]
        },
    )
    pairs: dict[str, list[CatalogueImage]] = {}
    for picture in pictures:
        pairs.setdefault(str(replace(picture.key, camera="L")), []).append(picture)
    for number, pair in enumerate(pairs.values(), 1):
        for picture in pair:
            yield from _messages(catalogue, picture, number * SECOND)


def _messages(catalogue: Catalogue, picture: CatalogueImage, time_ns: int) -> Iterator[Stamped]:
    side, camera = SIDES[picture.key.camera], catalogue.camera(picture)
    assert camera is not None  # stations are localised
    frame = f"{side}_optical"
    yield time_ns, f"/{side}/key", "std_msgs/msg/String", {"data": str(picture.key)}
    info = ros.camera_info(time_ns, frame, camera.lens)
    yield time_ns, f"/{side}/camera_info", "sensor_msgs/msg/CameraInfo", info
    image = ros.image(time_ns, frame, picture.path.read_bytes())
    yield time_ns, f"/{side}/image/compressed", "sensor_msgs/msg/CompressedImage", image
    rows = [
        {"kind": label.kind, "rock": label.rock, "confidence": label.confidence}
        | dict(zip(BOX.each, label.box, strict=True))
        for label in catalogue.labels(picture)
    ]
    yield time_ns, f"/{side}/labels", "vision_msgs/msg/Detection2DArray", ros.detections(time_ns, frame, rows)
