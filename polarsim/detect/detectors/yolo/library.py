"""Import of Ultralytics (AGPL-3.0), only in this module, offline and with local settings."""

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


def ultralytics(folder: Path) -> SimpleNamespace:
    """Import the required parts of Ultralytics. Its settings are stored in `folder` until the process ends."""
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
    finally:  # remove thread limits set by the import, which subprocesses would inherit
        for name in os.environ.keys() - environment.keys():
            del os.environ[name]
        os.environ.update(environment)
    tasks.SAFE_LOAD = True  # do not execute code of checkpoints, even if Ultralytics was imported before
    LOGGER.setLevel(logging.ERROR)  # callbacks log the progress instead
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
        # Disable the time limit, which drops boxes on a busy machine.
        non_max_suppression=partial(non_max_suppression, multi_label=True, max_time_img=1e9),
    )


def _isolate(config: Path) -> None:
    """Set environment variables for the import: no network, pip, code in checkpoints, or files outside `config`."""
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
    """Replace torchvision by a module with `ops.nms` if torchvision cannot be imported.

    The wheel on the package index requires CUDA and fails with a CPU build of torch. Detection needs only `nms`.
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
