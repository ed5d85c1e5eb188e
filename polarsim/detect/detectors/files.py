"""Reading and writing of detector files."""

from __future__ import annotations

import io
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from pydantic import TypeAdapter, ValidationError

from polarsim.detect.detectors.devices import load_torch
from polarsim.detect.options import TrainingOptions
from polarsim.errors import DetectError
from polarsim.formats.files import write_bytes
from polarsim.formats.readers import reader
from polarsim.formats.yaml_files import describe_error
from polarsim.photo import BOX_CLASSES

_FORMAT = "polarsim judge 1"


@dataclass(frozen=True)
class Detector:
    """Trained detector: architecture, training parameters and weights."""

    model: str  # architecture, such as yolov5n
    imgsz: int  # longer side of the training images, px
    epochs: int
    start: str  # "scratch", or the name of the initial weights
    state: dict[str, Any]  # tensors by name, half precision
    # Best inference widths by class, px, and the gates between them, see `inference_widths`. Empty: imgsz.
    sizes: tuple[tuple[tuple[int, ...], tuple[float, ...]], ...] = ()
    calibration: tuple[tuple[float, float], ...] = ()  # slope and offset of each class, see `detect.calibration`


def write_detector(path: Path, detector: Detector) -> None:
    """Write tensors and plain values without code, paths or dates. Equal detectors give equal bytes."""
    save_tensors(path, {"format": _FORMAT, "classes": list(BOX_CLASSES), **vars(detector)})


@reader("detector", error=DetectError)
def read_detector(path: Path) -> Detector:
    """Read a file of `write_detector` without executing code."""
    content = load_tensors(path)
    if not isinstance(content, dict) or content.get("format") != _FORMAT:
        raise DetectError(f"not a detector written by polarsim, expected format {_FORMAT!r}", path=path)
    if content.get("classes") != list(BOX_CLASSES):
        raise DetectError(f"detector with classes {content.get('classes')}, expected {list(BOX_CLASSES)}", path=path)
    fields = {name: content[name] for name in Detector.__dataclass_fields__ if name in content}  # fewer in older files
    try:
        detector = TypeAdapter(Detector).validate_python(fields)
        TrainingOptions(model=detector.model)
    except ValidationError as error:
        raise DetectError(describe_error(error, "detector"), path=path) from error
    count = len(BOX_CLASSES)
    if not {len(detector.sizes), len(detector.calibration)} <= {0, count}:
        raise DetectError(f"widths or calibration do not have {count} classes", path=path)
    if any(len(gates) != len(widths) - 1 for widths, gates in detector.sizes):
        raise DetectError("widths and gates do not match, expected one gate between adjacent widths", path=path)
    return detector


def save_tensors(path: Path, content: dict[str, Any]) -> None:
    """Write tensors and plain values. Equal content gives equal bytes."""
    buffer = io.BytesIO()  # with a path, torch writes the file name into the archive
    load_torch().save(content, buffer)
    write_bytes(path, buffer.getvalue())


@reader("detector", error=DetectError)
def load_tensors(path: Path) -> Any:
    """Read a file of `save_tensors` without executing code."""
    return load_torch().load(path, map_location="cpu", weights_only=True)
