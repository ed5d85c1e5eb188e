"""PLY clouds: points with normals, binary, float32."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from polarsim.errors import FormatError
from polarsim.formats.files import writing
from polarsim.formats.readers import reader

_COLUMNS = ("x", "y", "z", "nx", "ny", "nz")
_ROW = np.dtype([(name, "<f4") for name in _COLUMNS])
_LONGEST_HEADER = 4096  # bytes


@dataclass(frozen=True)
class Cloud:
    """Points (n, 3) in metres and unit normals (n, 3)."""

    points: np.ndarray
    normals: np.ndarray

    def __len__(self) -> int:
        return len(self.points)


def write_ply(path: str | Path, cloud: Cloud) -> None:
    """Write `x y z nx ny nz` as little-endian float32. An empty cloud makes a valid file."""
    properties = "".join(f"property float {name}\n" for name in _COLUMNS)
    header = f"ply\nformat binary_little_endian 1.0\nelement vertex {len(cloud)}\n{properties}end_header\n"
    rows = np.ascontiguousarray(np.column_stack([cloud.points, cloud.normals]).reshape(-1, 6), "<f4")
    with writing(path) as temporary:
        temporary.write_bytes(header.encode("ascii") + rows.tobytes())


@reader("PLY file", largest_mb=4000)
def read_ply(path: str | Path) -> Cloud:
    """Read a binary file of `write_ply`: vertices with six float properties."""
    content = Path(path).read_bytes()
    end = content.find(b"end_header\n", 0, _LONGEST_HEADER)
    if not content.startswith(b"ply\n") or end < 0:
        raise FormatError("no PLY header", path=path)
    lines = content[:end].decode("ascii", "replace").splitlines()
    if "format binary_little_endian 1.0" not in lines:
        raise FormatError("expected the format binary_little_endian 1.0", path=path)
    if [line.split() for line in lines if line.startswith("property")] != [["property", "float", c] for c in _COLUMNS]:
        raise FormatError(f"expected the float properties {' '.join(_COLUMNS)}", path=path)
    elements = [line.split() for line in lines if line.startswith("element")]
    if len(elements) != 1 or elements[0][:2] != ["element", "vertex"] or not elements[0][-1].isdigit():
        raise FormatError("unknown elements, expected only the element vertex", path=path)
    body = content[end + len(b"end_header\n") :]
    if len(body) != int(elements[0][-1]) * _ROW.itemsize:
        raise FormatError(f"{len(body)} bytes of points, expected {elements[0][-1]} x {_ROW.itemsize}", path=path)
    values = np.frombuffer(body, "<f4").reshape(-1, 6).astype(float)
    if not np.isfinite(values).all():
        raise FormatError("a value is not finite", path=path)
    return Cloud(values[:, :3], values[:, 3:])
