"""Import of torch and choice of the device."""

from __future__ import annotations

import os
import platform
from pathlib import Path
from typing import Any

from polarsim.errors import DetectError


def load_torch() -> Any:
    """Import torch."""
    # Effective only before the first import of torch. Actively waiting threads are many times slower if other jobs use
    # the cores.
    os.environ.setdefault("OMP_WAIT_POLICY", "PASSIVE")
    import torch

    return torch


def choose_device(device: str) -> str:
    """Return `cpu` or `cuda`; `cuda` that is not available is an error."""
    has_cuda = bool(load_torch().cuda.is_available())
    if device == "cuda" and not has_cuda:
        raise DetectError("device cuda is not available: set --device or detect.prediction.device to cpu or auto")
    return "cuda" if has_cuda and device != "cpu" else "cpu"


def computes_bfloat16(precision: str, device: str) -> bool:
    """Return whether `precision` selects bfloat16 on a device; `auto` selects the faster precision."""
    return has_fast_bfloat16(device) if precision == "auto" else precision == "bfloat16"


def has_fast_bfloat16(device: str) -> bool:
    """Return whether convolutions on `cpu` or `cuda` are faster in bfloat16 than in float32.

    AMD processors with AVX512-BF16 compute bfloat16 at twice the rate of float32. Intel processors need AMX: their
    AVX512-BF16 has the rate of float32, so that conversions make training and inference 1.3 times slower.
    """
    cpu = load_torch().cpu
    return has_bfloat16(device) and (device == "cuda" or cpu._is_amx_tile_supported() or _is_amd())


def has_bfloat16(device: str) -> bool:
    """Return whether `cpu` or `cuda` has instructions for bfloat16, which torch otherwise emulates."""
    torch = load_torch()
    return bool(torch.cuda.is_bf16_supported() if device == "cuda" else torch.cpu._is_avx512_bf16_supported())


def _is_amd() -> bool:
    described = Path("/proc/cpuinfo")  # Linux; other systems name the maker in `platform.processor`
    return "AuthenticAMD" in (described.read_text()[:1000] if described.exists() else platform.processor())
