"""COCO and YOLO data sets: boxes and masks for those who train detectors."""

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
from polarsim.publish.catalogue import Catalogue, Picture

UNASSIGNED = "unassigned"  # part of all pictures of a run that drew no split
PARTS = {"train": "train", "val": "val", "test": "test", "": UNASSIGNED}


def coco_bytes(picture: Picture) -> int:
    return picture.path.stat().st_size + 20_000


def yolo_bytes(picture: Picture) -> int:
    return picture.width * picture.height + 2000  # 8 bits; noise hardly packs


def write_coco(catalogue: Catalogue, bundle: Bundle) -> None:
    """`images/<domain>/KEY.png`, 16 bits, and `annotations/<domain>_<part>.json`."""
    for one in catalogue.pictures:
        bundle.copy(f"images/{one.name}.png", one.path)
    for domain in catalogue.domains:
        for part in dict.fromkeys(PARTS.values()):
            pictures = [one for one in catalogue.of_domain(domain) if PARTS[one.part] == part]
            if pictures:
                rows = [(_image(catalogue, one), catalogue.labels(one)) for one in pictures]
                bundle.make(
                    f"annotations/{domain}_{part}.json",
                    partial(
                        coco.write_pictures,
                        pictures=rows,
                        description=f"{terms.what_it_is(catalogue)} {terms.split_of(catalogue)}",
                    ),
                )


def _image(catalogue: Catalogue, picture: Picture) -> dict[str, object]:
    own = {"file_name": f"{picture.name}.png", "width": picture.width, "height": picture.height}
    said = {"domain": picture.domain, "origin": catalogue.picture_origin(picture), "part": picture.part}
    return {"id": coco.image_id(picture.key), **own, **key_columns(picture.key), **said}


def write_yolo(catalogue: Catalogue, bundle: Bundle) -> None:
    """A data set a domain: `<domain>/images/<part>/KEY.png` with 8 bits, labels beside, `<domain>.yaml`."""
    for domain in catalogue.domains:
        pictures = catalogue.of_domain(domain)
        for one in pictures:
            name = f"{PARTS[one.part]}/{one.key}"
            bundle.png(f"{domain}/images/{name}.png", partial(shown, one), [one.path])
            bundle.make(f"{domain}/labels/{name}.txt", partial(_write_boxes, catalogue, one))
        there = [part for part in PARTS.values() if any(PARTS[one.part] == part for one in pictures)]
        own = {part: part if part in there else there[0] for part in ("train", "val")}  # trainers ask for both
        own |= {"test": "test"} if "test" in there else {}
        folders = [f"{name}: images/{part}" for name, part in own.items()]
        lines = [f"# {terms.split_of(catalogue)}", f"path: {domain}  # from the folder of this file", *folders]
        names = [f"  {number}: {name}" for number, name in enumerate(BOX_CLASSES)]
        bundle.text(f"{domain}.yaml", "\n".join([*lines, "names:", *names, ""]))


def shown(picture: Picture) -> np.ndarray:
    """(h, w) uint8, by the curve that the run's own detectors are trained with: trainers read 16 bits as black."""
    return to_8_bits(png.read(picture.path))


def _write_boxes(catalogue: Catalogue, picture: Picture, path: Path) -> None:
    labels = catalogue.labels(picture)
    boxes = clip(np.array([one.box for one in labels], float).reshape(-1, 4), picture.width, picture.height)
    yolo.write_boxes(path, np.array([BOX_CLASSES.index(one.kind) for one in labels]), boxes, picture.size)
