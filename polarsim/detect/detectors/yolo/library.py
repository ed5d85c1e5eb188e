"""The one module that imports Ultralytics (AGPL-3.0): offline, and inside our folders."""

from __future__ import annotations

import atexit
import logging
import os
import shutil
import sys
from functools import partial
from pathlib import Path
from types import ModuleType, SimpleNamespace
from typing import Any

from polarsim.detect.detectors.devices import load_torch
from polarsim.detect.nms import nms
from polarsim.errors import DetectError


def ultralytics(folder: Path) -> SimpleNamespace:
    """The parts of Ultralytics that we use; its settings live in `folder` until the process ends.

    Raises
    ------
    DetectError
        Torch or Ultralytics is not installed.
    """
    if "ultralytics" not in sys.modules:
        _isolate(folder / f".ultralytics.{os.getpid()}")
    load_torch()
    environment = dict(os.environ)
    try:
        from ultralytics import YOLO, settings
        from ultralytics.models.yolo.detect import DetectionTrainer, DetectionValidator
        from ultralytics.nn import tasks
        from ultralytics.nn.tasks import DetectionModel, load_checkpoint
        from ultralytics.utils import LOGGER
        from ultralytics.utils.nms import non_max_suppression
    except ImportError as error:
        raise DetectError(f"Ultralytics cannot be imported ({error}): pip install 'polarsim[detect]'") from error
    finally:  # its import sets limits of threads, which the processes that we start would inherit
        for name in os.environ.keys() - environment.keys():
            del os.environ[name]
        os.environ.update(environment)
    tasks.SAFE_LOAD = True  # whoever imported it first: no code in checkpoints is run
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
