"""Start of Taichi: casters and kernels of reflectance share a device.

This module is only imported if the configuration selects Taichi. Taichi can only be called by the thread that started
it; therefore a dedicated thread executes all calls in turn. Taichi distributes the work itself. CUDA memory must be
freed on that thread, otherwise the process ends: arrays that outlive a call are passed to `free_later`.
"""
# mypy: ignore-errors

from __future__ import annotations

import atexit
import contextlib
import io
import os
import threading
from collections import deque
from collections.abc import Callable
from functools import wraps
from multiprocessing.pool import ThreadPool

os.environ.setdefault("ENABLE_TAICHI_HEADER_PRINT", "0")
import taichi as ti

from polarsim.errors import PolarsimError
from polarsim.geometry.ray_engines import Device

_this_thread = threading.local()
_dropped: deque[object] = deque()  # arrays on the device that are no longer used
_running: tuple[Device, int] | None = None  # device and number of threads of the current start
_starts = 0


def _mark() -> None:
    _this_thread.is_taichis = True


# A daemon thread still exists when the interpreter ends, for `_stop`.
_pool = ThreadPool(1, initializer=_mark)


def on_taichi_thread(work: Callable) -> Callable:
    """Decorate a function to run on Taichi's thread: necessary to start Taichi, copy arrays and call kernels."""

    @wraps(work)
    def asked(*args, **kwargs):
        if getattr(_this_thread, "is_taichis", False):
            return work(*args, **kwargs)
        return _pool.apply(_free_and_do, (work, args, kwargs))

    return asked


def free_later(arrays: object) -> None:
    """Keep arrays until Taichi's thread frees them, before its next call."""
    _dropped.append(arrays)


def _free_and_do(work: Callable, args: tuple, kwargs: dict) -> object:
    _dropped.clear()
    return work(*args, **kwargs)


@on_taichi_thread
def start(threads: int | None, device: Device = "cpu") -> None:
    """Start Taichi on a device, on the CPU with a number of threads; None: the current number, or one.

    A repeated start has no effect; a start with other arguments discards the data on the device.
    """
    global _running, _starts
    if threads is None or device != "cpu":
        threads = _running[1] if _running and _running[0] == device else 1
    if _running == (device, threads):
        return
    _running, _starts = None, _starts + 1
    arch = {"cpu": ti.cpu, "cuda": ti.cuda, "vulkan": ti.vulkan}[device]
    if not device_available(device):
        raise PolarsimError(f"taichi: no {device} device is available; choose another device")
    try:
        # Kernels compile in seconds: no cache in the home folder.
        with contextlib.redirect_stdout(io.StringIO()):  # Taichi prints its device
            ti.init(
                arch=arch, cpu_max_num_threads=threads, offline_cache=False, fast_math=False, log_level=ti.ERROR,
                default_fp=ti.f32, default_ip=ti.i32, enable_fallback=False,
            )  # fmt: skip
    except Exception as error:  # Taichi raises many types
        raise PolarsimError(f"taichi does not start on {device}, {str(error).splitlines()[0]}") from error
    _running = device, threads


def starts() -> int:
    """Return the number of starts of Taichi; data on the device from before the last start is lost."""
    return _starts


def device_available(device: Device) -> bool:
    """Return whether Taichi detects such a device."""
    from taichi._lib import core

    core.set_logging_level("error")  # hides messages about missing libraries
    return {"cpu": lambda: True, "cuda": core.with_cuda, "vulkan": core.with_vulkan}[device]()


@atexit.register
def _stop() -> None:
    """Reset the device on Taichi's thread, before the interpreter drops its arrays."""
    if _running is not None:
        on_taichi_thread(ti.reset)()
