"""COCO and YOLO data sets for training detectors: images, boxes and masks."""

from __future__ import annotations

from functools import partial
from pathlib import Path

import numpy as np

from polarsim.detect.tone import to_8_bits
from polarsim.formats import coco, png, yolo
from polarsim.formats.tables import key_columns
from polarsim.geometry.boxes import clip
from polarsim.photo import BOX_CLASSES
from polarsim.publish import terms
from polarsim.publish.bundle import Bundle
from polarsim.publish.catalogue import Catalogue, CatalogueImage

UNASSIGNED = "unassigned"  # part of all images of a run without a split
PARTS = {"train": "train", "val": "val", "test": "test", "": UNASSIGNED}


def write_coco_set(catalogue: Catalogue, bundle: Bundle) -> None:
    """Write `images/<domain>/KEY.png`, 16 bits, and `annotations/<domain>_<part>.json`."""
    for picture in catalogue.pictures:
        bundle.copy(f"images/{picture.name}.png", picture.path)
    for domain in catalogue.domains:
        for part in dict.fromkeys(PARTS.values()):
            pictures = [picture for picture in catalogue.of_domain(domain) if PARTS[picture.part] == part]
            if pictures:
                rows = [(_image(catalogue, picture), catalogue.labels(picture)) for picture in pictures]
                bundle.make(
                    f"annotations/{domain}_{part}.json",
                    partial(
                        coco.write_coco_images,
                        pictures=rows,
                        description=f"{terms.summary(catalogue)} {terms.split_of(catalogue)}",
                    ),
                )


def _image(catalogue: Catalogue, picture: CatalogueImage) -> dict[str, object]:
    file = {"file_name": f"{picture.name}.png", "width": picture.width, "height": picture.height}
    source = {"domain": picture.domain, "origin": catalogue.picture_origin(picture), "part": picture.part}
    return {"id": catalogue.site.image_id(picture.key), **file, **key_columns(picture.key), **source}


def write_yolo(catalogue: Catalogue, bundle: Bundle) -> None:
    """Write a data set per domain: `<domain>/images/<part>/KEY.png`, 8 bits, `<domain>/labels/`, `<domain>.yaml`."""
    for domain in catalogue.domains:
        pictures = catalogue.of_domain(domain)
        for picture in pictures:
            name = f"{PARTS[picture.part]}/{picture.key}"
            bundle.png(f"{domain}/images/{name}.png", partial(tone_mapped, picture), [picture.path])
            bundle.make(f"{domain}/labels/{name}.txt", partial(_write_boxes, catalogue, picture))
        present = [part for part in PARTS.values() if any(PARTS[picture.part] == part for picture in pictures)]
        part_of = {part: part if part in present else present[0] for part in ("train", "val")}  # both are required
        part_of |= {"test": "test"} if "test" in present else {}
        folders = [f"{name}: images/{part}" for name, part in part_of.items()]
        lines = [f"# {terms.split_of(catalogue)}", f"path: {domain}  # from the folder of this file", *folders]
        names = [f"  {number}: {name}" for number, name in enumerate(BOX_CLASSES)]
        bundle.text(f"{domain}.yaml", "\n".join([*lines, "names:", *names, ""]))


def tone_mapped(picture: CatalogueImage) -> np.ndarray:
    """Return an image (h, w) uint8 with the tone curve of the run's detectors; YOLO trainers expect 8 bits."""
    return to_8_bits(png.read_png(picture.path))


def _write_boxes(catalogue: Catalogue, picture: CatalogueImage, path: Path) -> None:
    labels = catalogue.labels(picture)
    boxes = clip(np.array([label.box for label in labels], float).reshape(-1, 4), picture.width, picture.height)
    yolo.write_boxes(path, np.array([BOX_CLASSES.index(label.kind) for label in labels]), boxes, picture.size)
