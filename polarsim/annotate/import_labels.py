"""Labels that others drew, out of the exports of their tools, as a folder of label files that a run starts from.

COCO, YOLO, CVAT for images 1.1, Label Studio (JSON and JSON-MIN), FiftyOne (labels.json and samples.json).
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np

from polarsim.errors import ConfigError, FormatError, PolarsimError
from polarsim.formats import yolo
from polarsim.formats.coco import read_coco
from polarsim.formats.files import read_json, writing_folder
from polarsim.formats.readers import reader, reading
from polarsim.formats.yaml_files import read_yaml
from polarsim.geometry.boxes import around, clip
from polarsim.photo import BOX_CLASSES, HEIGHT, WIDTH, PhotoKey

AUTO = "auto"
Drawn = tuple[str, np.ndarray]  # what a person called it, and its box (4,), px of the photo
Found = Iterator[tuple[str, list[Drawn]]]  # name of a picture and what was drawn in it
_SIZE = np.array([WIDTH, HEIGHT], float)
_SAME_SHAPE = 0.01  # largest relative difference of width over height of a picture that was made smaller
_LEAST_PX = 1e-3  # side of a box that is one


@reader("export of labels", largest_mb=500)
def import_labels(
    source: Path,
    folder: Path,
    form: str = AUTO,
    names: Mapping[str, str] | None = None,
    keep_empty: bool = False,
) -> tuple[int, int, list[str]]:
    """Write `KEY.txt` of every photo that was labelled; how many photos and boxes, and which photos had none.

    Parameters
    ----------
    source
        A file, or of YOLO a folder.
    folder
        A new folder, or an empty one.
    form
        One of `READERS`, or `AUTO`: told by what the source holds.
    names
        What else a rock or shadow is called there, such as boulder -> rock; an empty word leaves the thing out.
    keep_empty
        Whether a photo without a box is one in which a person saw nothing. Else it is left out: tools export pictures
        that nobody has looked at yet as well.

    Raises
    ------
    ConfigError
        The folder holds something, or no such form.
    FormatError
        The source is not what its form promises, names no photo or other things than rocks and shadows.
    """
    if folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
        raise ConfigError("not empty, and an import overwrites nothing: name a new folder", path=folder)
    form = format_of(source) if form == AUTO else form
    if form not in READERS:
        raise ConfigError(f"format {form!r}, expected {', '.join(READERS)} or {AUTO}")
    photos: dict[PhotoKey, tuple[list[int], list[np.ndarray]]] = {}
    with reading(f"export of {form}", source):
        for name, drawn in READERS[form](source):
            key = _key(source, name)
            if key in photos:
                raise FormatError(f"{key} is there twice", path=source)
            photos[key] = _classified(source, name, drawn, names or {})
    empty = [str(key) for key, (classes, _) in photos.items() if not classes]
    kept = {key: own for key, own in sorted(photos.items()) if own[0] or keep_empty}
    if not kept:
        raise FormatError("no labelled photo", path=source)
    with writing_folder(folder) as temporary:
        for key, (classes, boxes) in kept.items():
            yolo.write_boxes(temporary / f"{key}.txt", np.array(classes, int), np.array(boxes).reshape(-1, 4))
    return len(kept), sum(len(classes) for classes, _ in kept.values()), [] if keep_empty else sorted(empty)


@reader("export of labels", largest_mb=500)
def format_of(source: Path) -> str:
    """What a source is, by what it holds.

    Raises
    ------
    FormatError
        Nothing that is known.
    """
    if source.is_dir():
        if (source / "samples.json").is_file() or (source / "labels.json").is_file():
            return "fiftyone"
        return "yolo"
    if source.suffix.lower() == ".xml" and source.exists():
        return "cvat"
    if source.suffix.lower() == ".json" and source.exists():
        content = read_json(source)
        if isinstance(content, list):
            return "label-studio"
        if isinstance(content, dict) and ("samples" in content or isinstance(content.get("labels"), dict)):
            return "fiftyone"
        return "coco"
    reason = "neither a folder, nor .json, nor .xml: --format says what it is" if source.exists() else "no such file"
    raise FormatError(reason, path=source)


def _key(source: Path, name: str) -> PhotoKey:
    """Of a picture's name: with folders, another suffix, or signs and a dash in front, as tools put them."""
    stem = re.split(r"[\\/]", name)[-1]
    stem = stem if _is_key(stem) else stem.rsplit(".", 1)[0]
    try:
        return PhotoKey.parse(stem.rsplit("-", 1)[-1])
    except PolarsimError as error:
        raise FormatError(error.reason, path=source) from error


def _is_key(stem: str) -> bool:
    return re.search(r"_\d{4}$", stem) is not None


def _classified(
    source: Path, name: str, drawn: Iterable[Drawn], names: Mapping[str, str]
) -> tuple[list[int], list[np.ndarray]]:
    """Class numbers and boxes, cut at the photo's border."""
    classes, boxes = [], []
    for called, box in drawn:
        kind = names.get(called, called.strip().lower())
        if not kind:
            continue
        if kind not in BOX_CLASSES:
            raise FormatError(
                f"{name}: {called!r} is neither {' nor '.join(BOX_CLASSES)}: --name '{called}=rock', or "
                f"--name '{called}=' leaves it out",
                path=source,
            )
        cut = clip(np.asarray(box, float))
        if not np.isfinite(cut).all() or (cut[2:] - cut[:2] < _LEAST_PX).any():
            raise FormatError(f"{name}: a {kind} without area inside the photo", path=source)
        classes.append(BOX_CLASSES.index(kind))
        boxes.append(cut)
    return classes, boxes


def _coco(source: Path) -> Found:
    for key, labels in read_coco(source, kinds=None).items():
        yield str(key), [(one.kind, one.box) for one in labels]


def _yolo(source: Path) -> Found:
    """Every `KEY.txt` below a folder; classes by `classes.txt` beside it or above, or by a `data.yaml`."""
    if not source.is_dir():
        raise FormatError("YOLO labels lie in a folder", path=source)
    found = sorted(path for path in source.rglob("*.txt") if _is_key(path.stem))
    stated = _names_in_yaml(source)
    for path in found:
        lists = [above for above in (path.parent, *path.parents) if (above / yolo.CLASS_FILE).is_file()]
        inside = [above for above in lists if above == source or source in above.parents]
        names = dict(enumerate(yolo.class_names(inside[0]))) if inside else stated or dict(enumerate(BOX_CLASSES))
        classes, boxes = yolo.read_boxes_of_any(path)
        for number in classes:
            if int(number) not in names:
                raise FormatError(f"class {number}, the list has {len(names)}", path=path)
        yield path.stem, [(names[int(number)], box) for number, box in zip(classes, boxes, strict=True)]


def _names_in_yaml(folder: Path) -> dict[int, str]:
    """Of a data set's description, where there is one."""
    for path in sorted(folder.glob("*.y*ml")):
        content = read_yaml(path)
        names = content.get("names") if isinstance(content, dict) else None
        if isinstance(names, list):
            return dict(enumerate(map(str, names)))
        if isinstance(names, dict):
            return {int(number): str(name) for number, name in names.items()}
    return {}


def _cvat(source: Path) -> Found:
    """CVAT for images 1.1: boxes, and boxes around polygons."""
    with reading("XML", source):
        root = ElementTree.parse(source).getroot()  # noqa: S314  # expat stops entities that blow up
    for image in root.iter("image"):
        name = image.attrib["name"]
        factor = _factor(source, name, float(image.attrib["width"]), float(image.attrib["height"]))
        drawn = []
        for shape in image:
            if shape.tag == "box":
                edges = np.array([float(shape.attrib[edge]) for edge in ("xtl", "ytl", "xbr", "ybr")])
            elif shape.tag == "polygon":
                corners = [point.split(",") for point in shape.attrib["points"].split(";")]
                edges = around(np.array(corners, float))
            else:
                continue
            drawn.append((shape.attrib["label"], edges * factor))
        yield name, drawn


def _factor(source: Path, name: str, width: float, height: float) -> float:
    """From a picture of another size to the photo's pixels."""
    if abs(width / height * HEIGHT / WIDTH - 1) > _SAME_SHAPE:
        raise FormatError(f"{name}: {width:g} x {height:g} px, a photo has {WIDTH} x {HEIGHT}", path=source)
    return WIDTH / width


def _label_studio(source: Path) -> Found:
    """Tasks as JSON or JSON-MIN; of a task's annotations the last that was not cancelled, never a prediction."""
    for task in read_json(source):
        data = task.get("data", task)
        name = str(data.get("key") or data["image"])
        if "annotations" in task:
            done = [one for one in task["annotations"] if not one.get("was_cancelled")]
            results = [dict(one["value"]) for one in (done[-1]["result"] if done else ()) if "value" in one]
        else:
            results = list(task.get("label") or task.get("bbox") or ())
        yield name, [drawn for one in results for drawn in _of_label_studio(one)]


def _of_label_studio(value: dict[str, Any]) -> Iterator[Drawn]:
    """Percent of the picture's size; a rectangle is turned about its upper left corner."""
    called = value.get("rectanglelabels") or value.get("polygonlabels") or ()
    if not called:
        return
    if "points" in value:
        corners = np.array(value["points"], float)
    else:
        turn = np.radians(float(value.get("rotation", 0)))
        across, down = float(value["width"]) * WIDTH, float(value["height"]) * HEIGHT
        corners = np.array([[0, 0], [across, 0], [across, down], [0, down]])  # in 0.01 px: turned where it is square
        corners = corners @ np.array([[np.cos(turn), np.sin(turn)], [-np.sin(turn), np.cos(turn)]])
        corners = corners / _SIZE + [float(value["x"]), float(value["y"])]
    yield str(called[0]), around(corners * _SIZE / 100)


def _fiftyone(source: Path) -> Found:
    """A `labels.json` (FiftyOneImageDetectionDataset), a `samples.json` (FiftyOneDataset), or the folder of one."""
    if source.is_dir():
        source = next(path for path in (source / "samples.json", source / "labels.json") if path.is_file())
    content = read_json(source)
    if "samples" in content:
        for sample in content["samples"]:
            fields = {k: v for k, v in sample.items() if isinstance(v, dict) and v.get("_cls") == "Detections"}
            field = "ground_truth" if "ground_truth" in fields else next(iter(fields), None)
            if len(fields) > 1 and field != "ground_truth":
                raise FormatError(f"fields {', '.join(sorted(fields))}: call one of them ground_truth", path=source)
            yield sample["filepath"], _relative(fields[field]["detections"] if field else (), ())
        return
    for name, detections in content["labels"].items():
        yield name, _relative(detections or (), content.get("classes") or ())


def _relative(detections: Iterable[Mapping[str, Any]], classes: Iterable[str]) -> list[Drawn]:
    listed = list(classes)
    drawn = []
    for one in detections:
        x, y, width, height = map(float, one["bounding_box"])
        called = listed[one["label"]] if isinstance(one["label"], int) else one["label"]
        drawn.append((str(called), np.array([x, y, x + width, y + height]) * np.tile(_SIZE, 2)))
    return drawn


READERS: dict[str, Callable[[Path], Found]] = {
    "coco": _coco,
    "yolo": _yolo,
    "cvat": _cvat,
    "label-studio": _label_studio,
    "fiftyone": _fiftyone,
}
