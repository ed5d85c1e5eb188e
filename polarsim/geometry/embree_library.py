"""Intel's Embree 4 from the wheel of embreex, called through its C interface.

The classes of embreex copy meshes and directions element by element in Python; Embree reads NumPy's arrays without a
copy. Names and numbers: embree4/rtcore_*.h of Embree 4.4.
"""

from __future__ import annotations

import ctypes
import weakref
from functools import cache
from importlib import metadata
from pathlib import Path

import numpy as np

from polarsim.errors import PolarsimError

_POINTER, _SIZE = ctypes.c_void_p, ctypes.c_size_t
_TRIANGLES, _INSTANCE = 0, 121  # RTC_GEOMETRY_TYPE_TRIANGLE, _INSTANCE
_INDICES, _VERTICES = 0, 1  # RTC_BUFFER_TYPE_INDEX, _VERTEX
_THREE_INTEGERS, _THREE_FLOATS = 0x5003, 0x9003  # RTC_FORMAT_UINT3, _FLOAT3
ROBUST = 1 << 2  # RTC_SCENE_FLAG_ROBUST: no ray passes between triangles at a shared edge
_NATIVE_16 = 34  # RTC_DEVICE_PROPERTY_NATIVE_RAY16_SUPPORTED
_ONE_THREAD = b"threads=1,set_affinity=0"  # makes the tree, and which triangle is hit at a shared edge, reproducible

_INTERFACE: dict[str, tuple[object, list[object]]] = {
    "rtcNewDevice": (_POINTER, [ctypes.c_char_p]),
    "rtcGetDeviceError": (ctypes.c_int, [_POINTER]),
    "rtcGetDeviceProperty": (ctypes.c_ssize_t, [_POINTER, ctypes.c_int]),
    "rtcNewScene": (_POINTER, [_POINTER]),
    "rtcReleaseScene": (None, [_POINTER]),
    "rtcSetSceneFlags": (None, [_POINTER, ctypes.c_int]),
    "rtcCommitScene": (None, [_POINTER]),
    "rtcNewGeometry": (_POINTER, [_POINTER, ctypes.c_int]),
    "rtcReleaseGeometry": (None, [_POINTER]),
    "rtcSetSharedGeometryBuffer": (
        None,
        [_POINTER, ctypes.c_int, ctypes.c_uint, ctypes.c_int, _POINTER, _SIZE, _SIZE, _SIZE],
    ),
    "rtcUpdateGeometryBuffer": (None, [_POINTER, ctypes.c_int, ctypes.c_uint]),
    "rtcSetGeometryInstancedScene": (None, [_POINTER, _POINTER]),
    "rtcSetGeometryMask": (None, [_POINTER, ctypes.c_uint]),
    "rtcCommitGeometry": (None, [_POINTER]),
    "rtcAttachGeometry": (ctypes.c_uint, [_POINTER, _POINTER]),
}


@cache
def embree() -> ctypes.CDLL:
    """Load the library and declare its functions."""
    try:
        import embreex.rtcore_scene  # noqa: F401  (loads the thread library of Embree)

        files = metadata.files("embreex") or []
    except (ImportError, metadata.PackageNotFoundError) as error:
        raise PolarsimError(f"rays: engine 'embree' cannot be loaded ({error}); install embreex") from error
    paths = [Path(str(file.locate())) for file in files if file.name.startswith(("libembree4", "embree4"))]
    if not paths:
        raise PolarsimError("rays: this embreex does not include Embree 4; install embreex 4.4 or newer")
    library = ctypes.CDLL(str(paths[0]))
    for name, (result, arguments) in _INTERFACE.items():
        function = getattr(library, name)
        function.restype, function.argtypes = result, arguments
    return library


class EmbreeScene:
    """Triangles `faces` (f, 3) of `vertices` (v, 3) with Embree's tree; `address` is the RTCScene."""

    def __init__(self, vertices: np.ndarray, faces: np.ndarray) -> None:
        library = embree()
        self._vertices, self._faces = padded(vertices), np.require(faces, np.uint32, ["C", "A"])
        self.address: int = library.rtcNewScene(device())
        weakref.finalize(self, library.rtcReleaseScene, self.address)
        library.rtcSetSceneFlags(self.address, ROBUST)
        library.rtcReleaseGeometry(attach(self.address, self._vertices, self._faces))  # the scene keeps it
        library.rtcCommitScene(self.address)
        check(len(faces))


def padded(vertices: np.ndarray) -> np.ndarray:
    """Return a buffer (v + 1, 3) float32 with vertices (v, 3): Embree reads 16 bytes of every vertex."""
    room = np.zeros((len(vertices) + 1, 3), np.float32)
    room[:-1] = vertices
    return room


def attach(scene: int, vertices: np.ndarray, faces: np.ndarray, mask: int = 1) -> int:
    """Add `padded` vertices and faces (f, 3) uint32, which must not be moved; return the RTCGeometry to release.

    `mask`: bits of the rays that can hit these triangles; Embree's default is 1.
    """
    geometry: int = embree().rtcNewGeometry(device(), _TRIANGLES)
    for kind, form, numbers, count in (
        (_INDICES, _THREE_INTEGERS, faces, len(faces)),
        (_VERTICES, _THREE_FLOATS, vertices, len(vertices) - 1),
    ):
        embree().rtcSetSharedGeometryBuffer(geometry, kind, 0, form, numbers.ctypes.data, 0, 12, count)
    return _attach(scene, geometry, mask)


def attach_scene(scene: int, part: int, mask: int) -> int:
    """Add a scene to another scene for rays that share a bit with `mask`; return the RTCGeometry to release."""
    geometry: int = embree().rtcNewGeometry(device(), _INSTANCE)
    embree().rtcSetGeometryInstancedScene(geometry, part)
    return _attach(scene, geometry, mask)


def _attach(scene: int, geometry: int, mask: int) -> int:
    embree().rtcSetGeometryMask(geometry, mask)
    embree().rtcCommitGeometry(geometry)
    embree().rtcAttachGeometry(scene, geometry)
    return geometry


def updated(geometry: int, *, vertices: bool) -> None:
    """Notify Embree that a geometry's vertices, or the scene in it, have changed."""
    if vertices:
        embree().rtcUpdateGeometryBuffer(geometry, _VERTICES, 0)
    embree().rtcCommitGeometry(geometry)


def check(faces: int) -> None:
    """Raise a PolarsimError if Embree refused the last build."""
    if code := embree().rtcGetDeviceError(device()):
        raise PolarsimError(f"rays: Embree cannot build a tree of {faces} triangles, error {code}")


@cache
def device() -> int:
    """Return the only device: with a second device, a thread of Embree would spin until the process ends."""
    return int(embree().rtcNewDevice(_ONE_THREAD))


@cache
def packet_size() -> int:
    """Return the number of rays in a packet on this processor: 16 with AVX-512, else 8."""
    return 16 if embree().rtcGetDeviceProperty(device(), _NATIVE_16) else 8
