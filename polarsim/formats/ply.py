"""PLY clouds: points with normals, binary, float32."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from polarsim.errors import FormatError
from polarsim.formats.files import write_bytes
from polarsim.formats.readers import reader

_PROPERTIES = "".join(f"property float {name}\n" for name in ("x", "y", "z", "nx", "ny", "nz"))
_HEADER = f"ply\nformat binary_little_endian 1.0\nelement vertex {{}}\n{_PROPERTIES}end_header\n"


@dataclass(frozen=True)
class Cloud:
    """Points (n, 3) in metres and unit normals (n, 3)."""

    points: np.ndarray
    normals: np.ndarray

    def __len__(self) -> int:
        return len(self.points)


def write_ply(path: str | Path, cloud: Cloud) -> None:
    """Write `x y z nx ny nz` as little-endian float32. An empty cloud makes a valid file."""
    rows = np.ascontiguousarray(np.column_stack([cloud.points, cloud.normals]).reshape(-1, 6), "<f4")
    write_bytes(path, _HEADER.format(len(cloud)).encode() + rows.tobytes())


@reader("PLY file", largest_mb=4000)
def read_ply(path: str | Path) -> Cloud:
    """Read a file of `write_ply`."""
    content = Path(path).read_bytes()
    header = re.match(_HEADER.format("([0-9]+)").encode(), content)
    if header is None:
        raise FormatError(f"expected the header {_HEADER.format('N')}")
    values = np.frombuffer(content, "<f4", offset=header.end()).reshape(int(header[1]), 6).astype(float)
    if not np.isfinite(values).all():
        raise FormatError("a value is not finite")
    return Cloud(values[:, :3], values[:, 3:])
