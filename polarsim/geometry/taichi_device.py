"""Taichi, started once for all that uses it: casters and kernels of reflectance share one device.

Imported only where the configuration asks for it. Taichi can be called by the one thread that started it, so it has a
thread of its own here: what any other thread asks for is done there in turn. Taichi shares its work out itself.
CUDA frees memory on that thread only, or ends the process: arrays that outlive a call are handed to `free_later`.
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
from polarsim.geometry.rays import Device

_this_thread = threading.local()
_dropped: deque[object] = deque()  # arrays on the device that nothing uses any more
_running: tuple[Device, int] | None = None  # device and threads that Taichi was started with
_starts = 0


def _mark() -> None:
    _this_thread.is_taichis = True


# Its thread is a daemon: it is still there when the interpreter ends, for `_stop`.
_pool = ThreadPool(1, initializer=_mark)


def on_its_thread(work: Callable) -> Callable:
    """The function, done on Taichi's thread: everything that starts Taichi, lays arrays there or calls kernels."""

    @wraps(work)
    def asked(*args, **kwargs):
        if getattr(_this_thread, "is_taichis", False):
            return work(*args, **kwargs)
        return _pool.apply(_free_and_do, (work, args, kwargs))

    return asked


def free_later(arrays: object) -> None:
    """Hold arrays until Taichi's thread frees them, before whatever it does next."""
    _dropped.append(arrays)


def _free_and_do(work: Callable, args: tuple, kwargs: dict) -> object:
    _dropped.clear()
    return work(*args, **kwargs)


@on_its_thread
def start(threads: int | None, device: Device = "cpu") -> None:
    """Start Taichi on a device, on the CPU with so many threads; None: as many as it runs with, else one.

    The same start again does nothing; another one loses what lies on the device.

    Raises
    ------
    PolarsimError
        The device is not there, or Taichi does not start.
    """
    global _running, _starts
    if threads is None or device != "cpu":
        threads = _running[1] if _running and _running[0] == device else 1
    if _running == (device, threads):
        return
    _running, _starts = None, _starts + 1
    arch = {"cpu": ti.cpu, "cuda": ti.cuda, "vulkan": ti.vulkan}[device]
    if not is_there(device):
        raise PolarsimError(f"taichi: no {device} device is here")
    try:
        # Kernels compile in seconds: no cache in anyone's home folder.
        with contextlib.redirect_stdout(io.StringIO()):  # Taichi prints where it starts
            ti.init(
                arch=arch, cpu_max_num_threads=threads, offline_cache=False, fast_math=False, log_level=ti.ERROR,
                default_fp=ti.f32, default_ip=ti.i32, enable_fallback=False,
            )  # fmt: skip
    except Exception as error:  # Taichi raises many kinds
        raise PolarsimError(f"taichi does not start on {device}, {str(error).splitlines()[0]}") from error
    _running = device, threads


def starts() -> int:
    """How often Taichi was started anew: what was laid on the device before the last start is gone."""
    return _starts


def is_there(device: Device) -> bool:
    """Whether Taichi finds such a device."""
    from taichi._lib import core

    core.set_logging_level("error")  # looking for a library that is not there is no news
    return {"cpu": lambda: True, "cuda": core.with_cuda, "vulkan": core.with_vulkan}[device]()


@atexit.register
def _stop() -> None:
    """Leave the device on Taichi's thread: its arrays, which the interpreter drops later, are gone by then."""
    if _running is not None:
        on_its_thread(ti.reset)()
