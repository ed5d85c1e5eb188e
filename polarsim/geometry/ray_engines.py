"""Names of the engines and devices that intersect rays and triangles; see `casters` and `rays`."""

from typing import Literal

RayEngine = Literal["embree", "taichi", "numpy"]
Device = Literal["cpu", "cuda", "vulkan"]  # devices of Taichi
