"""Detectors as files."""

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
    """A trained detector: its architecture, how it was trained, and its tensors."""

    model: str  # architecture, such as yolov5n
    imgsz: int  # px, longer side of the pictures it was trained on
    epochs: int
    start: str  # "scratch", or the name of the weights it started from
    state: dict[str, Any]  # tensors by name, half precision
    # By class, widths at which it looks at pictures best, px, and gates between them, see `detect.sizes`; none: imgsz.
    sizes: tuple[tuple[tuple[int, ...], tuple[float, ...]], ...] = ()
    calibration: tuple[tuple[float, float], ...] = ()  # slope and offset of each class, see `detect.calibration`


def write_detector(path: Path, detector: Detector) -> None:
    """Tensors and plain values only: no code to run on loading, no paths or dates, same detector same bytes."""
    save(path, {"format": _FORMAT, "classes": list(BOX_CLASSES), **vars(detector)})


@reader("detector", error=DetectError)
def read_detector(path: Path) -> Detector:
    """Read what `write_detector` wrote; nothing in the file is executed.

    Raises
    ------
    DetectError
        The file is missing, or is no detector of ours.
    """
    content = load(path)
    if not isinstance(content, dict) or content.get("format") != _FORMAT:
        raise DetectError(f"not weights that polarsim wrote, expected format {_FORMAT!r}", path=path)
    if content.get("classes") != list(BOX_CLASSES):
        raise DetectError(f"a detector of classes {content.get('classes')}, expected {list(BOX_CLASSES)}", path=path)
    known = {name: content[name] for name in Detector.__dataclass_fields__ if name in content}  # older ones have fewer
    try:
        detector = TypeAdapter(Detector).validate_python(known)
        TrainingOptions(model=detector.model)
    except ValidationError as error:
        raise DetectError(describe_error(error, "detector"), path=path) from error
    count = len(BOX_CLASSES)
    if not {len(detector.sizes), len(detector.calibration)} <= {0, count}:
        raise DetectError(f"widths or calibration not of {count} classes", path=path)
    if any(len(gates) != len(widths) - 1 for widths, gates in detector.sizes):
        raise DetectError("widths and gates that do not go together: there is one gate fewer", path=path)
    return detector


def save(path: Path, content: dict[str, Any]) -> None:
    """Write tensors and plain values; same content, same bytes."""
    buffer = io.BytesIO()  # torch would put a file's name into the archive
    load_torch().save(content, buffer)
    write_bytes(path, buffer.getvalue())


@reader("detector", error=DetectError)
def load(path: Path) -> Any:
    """Read what `save` wrote; nothing in the file is executed.

    Raises
    ------
    DetectError
        The file is missing, or is none.
    """
    torch = load_torch()
    return torch.load(path, map_location="cpu", weights_only=True)
