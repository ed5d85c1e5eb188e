"""Judges as files, and the one place that imports Ultralytics (AGPL-3.0) and torch: offline, and inside our folders."""

from __future__ import annotations

import atexit
import io
import logging
import os
import shutil
import sys
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from types import ModuleType, SimpleNamespace
from typing import Any

from polarsim.detect.nms import nms
from polarsim.errors import DetectError
from polarsim.formats.files import writing
from polarsim.photo import BOX_CLASSES

_FORMAT = "polarsim judge 1"


@dataclass(frozen=True)
class Judge:
    """A trained detector: its architecture, how it was trained, and its tensors."""

    model: str  # architecture, such as yolov5n
    imgsz: int  # px, longer side of the pictures it was trained on
    epochs: int
    start: str  # "scratch", or the name of the weights it started from
    state: dict[str, Any]  # tensors by name, half precision


def write_judge(path: Path, judge: Judge) -> None:
    """Tensors and plain values only: no code to run on loading, no paths or dates, same judge same bytes."""
    torch = _torch()
    content = {"format": _FORMAT, "classes": list(BOX_CLASSES), **vars(judge)}
    buffer = io.BytesIO()  # torch would put a file's name into the archive
    torch.save(content, buffer)
    with writing(path) as temporary:
        temporary.write_bytes(buffer.getvalue())


def read_judge(path: Path) -> Judge:
    """Read what `write_judge` wrote; nothing in the file is executed.

    Raises
    ------
    DetectError
        The file is missing, or is no judge of ours.
    """
    torch = _torch()
    try:
        content = torch.load(path, map_location="cpu", weights_only=True)
    except Exception as error:  # torch raises many kinds
        raise DetectError(f"{path}: no readable judge, {str(error).splitlines()[0]}") from error
    if not isinstance(content, dict) or content.get("format") != _FORMAT:
        raise DetectError(f"{path}: not weights that polarsim wrote, expected format {_FORMAT!r}")
    if tuple(content["classes"]) != BOX_CLASSES:
        raise DetectError(f"{path}: a judge of classes {content['classes']}, expected {list(BOX_CLASSES)}")
    return Judge(**{name: content[name] for name in Judge.__dataclass_fields__})


def judge_name(model: str) -> str:
    """Ultralytics builds YOLOv5's body with its later anchor-free head; the tables must not call that YOLOv5."""
    return f"{model} (YOLOv5u)"


def network(judge: Judge, folder: Path) -> Any:
    """The judge as a torch module that is ready to predict. `folder`: see `ultralytics`."""
    module = ultralytics(folder).DetectionModel(f"{judge.model}.yaml", nc=len(BOX_CLASSES), verbose=False)
    try:
        module.load_state_dict({name: value.float() for name, value in judge.state.items()})
    except RuntimeError as error:
        raise DetectError(f"weights do not fit {judge.model}: {str(error).splitlines()[0]}") from error
    return module.eval().fuse(verbose=False)


def load_start(path: Path, model: str, folder: Path) -> Any:
    """Weights to start a training from, as a torch module: a judge of ours or an Ultralytics checkpoint.

    Raises
    ------
    DetectError
        The file is missing or holds no such weights.
    """
    if not path.is_file():
        raise DetectError(f"{path}: the pretrained weights are missing")
    library = ultralytics(folder)
    try:
        judge = read_judge(path)
    except DetectError:
        try:
            return library.load_checkpoint(str(path))[0]
        except Exception as error:
            raise DetectError(f"{path}: no weights of {model}, {str(error).splitlines()[0]}") from error
    module = library.DetectionModel(f"{judge.model}.yaml", nc=len(BOX_CLASSES), verbose=False)
    module.load_state_dict({name: value.float() for name, value in judge.state.items()})
    return module


def choose_device(device: str) -> str:
    """`cpu` or `cuda`.

    Raises
    ------
    DetectError
        CUDA is asked for and is not there.
    """
    there = bool(_torch().cuda.is_available())
    if device == "cuda" and not there:
        raise DetectError("device cuda is configured, torch finds none: set detect.device to cpu or auto")
    return "cuda" if there and device != "cpu" else "cpu"


def ultralytics(folder: Path) -> SimpleNamespace:
    """The parts of Ultralytics that we use; its settings live in `folder` until the process ends.

    Raises
    ------
    DetectError
        Torch or Ultralytics is not installed.
    """
    if "ultralytics" not in sys.modules:
        _isolate(folder / f".ultralytics.{os.getpid()}")
    _torch()
    try:
        from ultralytics import YOLO, settings
        from ultralytics.models.yolo.detect import DetectionTrainer, DetectionValidator
        from ultralytics.nn.tasks import DetectionModel, load_checkpoint
        from ultralytics.utils import LOGGER
        from ultralytics.utils.nms import non_max_suppression
    except ImportError as error:
        raise DetectError(f"Ultralytics cannot be imported ({error}): pip install 'polarsim[detect]'") from error
    LOGGER.setLevel(logging.ERROR)  # its progress comes through our log, from callbacks
    if settings["sync"]:
        uses = ("sync", "clearml", "comet", "dvc", "mlflow", "neptune", "raytune", "tensorboard", "wandb")
        settings.update({name: False for name in uses if name in settings})
    _ensure_torchvision()
    return SimpleNamespace(
        YOLO=YOLO,
        DetectionTrainer=DetectionTrainer,
        DetectionValidator=DetectionValidator,
        DetectionModel=DetectionModel,
        load_checkpoint=load_checkpoint,
        # By itself it stops after some seconds, and on a busy machine the rest of the pictures would have no boxes.
        non_max_suppression=partial(non_max_suppression, multi_label=True, max_time_img=1e9),
    )


def _torch() -> Any:
    # Read when torch is first imported. Its threads spin while they wait for each other; where other jobs hold the
    # cores that makes two threads many times slower than one.
    os.environ.setdefault("OMP_WAIT_POLICY", "PASSIVE")
    try:
        import torch
    except ImportError as error:
        raise DetectError(f"torch cannot be imported ({error}): pip install 'polarsim[detect]'") from error
    return torch


def _isolate(config: Path) -> None:
    """Ultralytics reads these when it is imported: no network, no pip, no code in checkpoints, no file elsewhere."""
    config.mkdir(parents=True, exist_ok=True)
    atexit.register(shutil.rmtree, config, ignore_errors=True)
    os.environ.update(
        YOLO_CONFIG_DIR=str(config.resolve()),
        YOLO_OFFLINE="true",
        YOLO_AUTOINSTALL="false",
        YOLO_VERBOSE="false",
        ULTRALYTICS_SAFE_LOAD="1",
    )


def _ensure_torchvision() -> None:
    """Put a module with `ops.nms` in torchvision's place where its wheel cannot run.

    The wheel on the package index is built against CUDA; beside a CPU torch its import fails, although detection needs
    nothing of it but `nms`.
    """
    if getattr(sys.modules.get("torchvision"), "stands_in", False):
        return
    try:
        import torchvision

        torchvision.extension._assert_has_ops()
    except (ImportError, RuntimeError, AttributeError):
        import importlib.machinery

        for name in [name for name in sys.modules if name.split(".")[0] == "torchvision"]:
            del sys.modules[name]
        for name in ("torchvision", "torchvision.ops"):
            sys.modules[name] = ModuleType(name)
            sys.modules[name].__spec__ = importlib.machinery.ModuleSpec(name, None)
        stand_in: Any = sys.modules["torchvision"]
        stand_in.stands_in, stand_in.ops = True, sys.modules["torchvision.ops"]
        stand_in.ops.nms = nms
