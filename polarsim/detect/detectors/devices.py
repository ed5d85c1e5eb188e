"""Torch, and where it computes."""

from __future__ import annotations

import os
from typing import Any

from polarsim.errors import DetectError


def load_torch() -> Any:
    """The module torch.

    Raises
    ------
    DetectError
        It is not installed.
    """
    # Read when torch is first imported. Its threads spin while they wait for each other; where other jobs hold the
    # cores that makes two threads many times slower than one.
    os.environ.setdefault("OMP_WAIT_POLICY", "PASSIVE")
    try:
        import torch
    except ImportError as error:
        raise DetectError(f"torch cannot be imported ({error}): pip install 'polarsim[detect]'") from error
    return torch


def choose_device(device: str) -> str:
    """`cpu` or `cuda`.

    Raises
    ------
    DetectError
        CUDA is asked for and is not there.
    """
    there = bool(load_torch().cuda.is_available())
    if device == "cuda" and not there:
        raise DetectError("device cuda is configured, torch finds none: set detect.prediction.device to cpu or auto")
    return "cuda" if there and device != "cpu" else "cpu"


def computes_bfloat16(precision: str, device: str) -> bool:
    """Whether a training computes in bfloat16, see `TrainingOptions.precision`; emulated it would be slower."""
    return has_bfloat16(device) if precision == "auto" else precision == "bfloat16"


def has_bfloat16(device: str) -> bool:
    """Return whether `cpu` or `cuda` has instructions for bfloat16; torch emulates them elsewhere."""
    torch = load_torch()
    return bool(torch.cuda.is_bf16_supported() if device == "cuda" else torch.cpu._is_avx512_bf16_supported())
