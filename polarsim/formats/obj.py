"""OBJ meshes as the release has them: metres, x y z in the sandbox frame, triangles, vertex normals, no material."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from polarsim.errors import FormatError
from polarsim.formats.files import writing

_ROCK_NAME = re.compile(r"terrain(\d\d)_rock(\d+)(_decimate-005)?\.obj")


@dataclass(frozen=True)
class Mesh:
    """Triangles: vertices (v, 3) in metres, faces (f, 3) vertex numbers, counter-clockwise seen from outside."""

    vertices: np.ndarray
    faces: np.ndarray

    def normals(self) -> np.ndarray:
        """(v, 3) unit vertex normals, weighted by area; zero where a vertex has no face."""
        a, b, c = (self.vertices[self.faces[:, k]] for k in range(3))
        face_normals = np.cross(b - a, c - a)
        normals = np.zeros_like(self.vertices)
        for k in range(3):
            np.add.at(normals, self.faces[:, k], face_normals)
        length = np.linalg.norm(normals, axis=1, keepdims=True)
        return np.divide(normals, length, out=np.zeros_like(normals), where=length > 0)


def rock_name(terrain: int, rock: int, *, decimated: bool = False) -> str:
    """File name of a rock, `terrain01_rock3.obj`."""
    return f"terrain{terrain:02d}_rock{rock}{'_decimate-005' if decimated else ''}.obj"


def ground_name(terrain: int) -> str:
    return f"terrain{terrain:02d}_ground.obj"


def parse_rock_name(name: str) -> tuple[int, int, bool] | None:
    """Terrain, rock id and whether it is a decimated copy; None for other names."""
    found = _ROCK_NAME.fullmatch(name)
    return (int(found[1]), int(found[2]), found[3] is not None) if found else None


def rock_files(folder: str | Path) -> dict[int, Path]:
    """The rock meshes of a folder by id: the full one, or the decimated copy where only that is there."""
    found: dict[int, Path] = {}
    for path in sorted(Path(folder).glob("*.obj")):
        parsed = parse_rock_name(path.name)
        if parsed and (not parsed[2] or parsed[1] not in found):
            found[parsed[1]] = path
    return dict(sorted(found.items()))


def read(path: str | Path) -> Mesh:
    """Vertices and triangles of an OBJ file; polygons are cut into fans, all other lines are passed over.

    Raises
    ------
    FormatError
        The file is missing, has no triangle, or a face names a vertex that is not there.
    """
    vertices: list[list[float]] = []
    faces: list[list[int]] = []
    try:
        with Path(path).open(encoding="ascii") as lines:
            for number, line in enumerate(lines, 1):
                try:
                    if line.startswith("v "):
                        x, y, z = line.split()[1:4]
                        vertices.append([float(x), float(y), float(z)])
                    elif line.startswith("f "):
                        corners = [int(field.split("/", 1)[0]) for field in line.split()[1:]]
                        corners = [c - 1 if c > 0 else len(vertices) + c for c in corners]
                        faces += [[corners[0], corners[k], corners[k + 1]] for k in range(1, len(corners) - 1)]
                except ValueError as error:
                    raise FormatError(f"{path}:{number}: {error}") from error
    except (OSError, UnicodeDecodeError) as error:
        raise FormatError(f"{path}: no readable OBJ file, {error}") from error
    mesh = Mesh(np.array(vertices, float).reshape(-1, 3), np.array(faces, np.int64).reshape(-1, 3))
    if not len(mesh.faces):
        raise FormatError(f"{path}: no triangle")
    if mesh.faces.min() < 0 or mesh.faces.max() >= len(mesh.vertices):
        raise FormatError(f"{path}: a face names vertex {mesh.faces.max() + 1} of {len(mesh.vertices)}")
    if not np.isfinite(mesh.vertices).all():
        raise FormatError(f"{path}: a vertex is not finite")
    return mesh


def write(path: str | Path, mesh: Mesh, name: str) -> None:
    """Write with vertex normals, micrometre steps: same mesh, same bytes."""
    import pandas as pd

    with writing(path) as temporary, temporary.open("w", encoding="ascii", newline="\n") as file:
        file.write(f"# polarsim, metres, sandbox frame\no {name}\n")
        rows = pd.DataFrame(mesh.vertices)
        rows.insert(0, "tag", "v")
        rows.to_csv(file, sep=" ", header=False, index=False, float_format="%.6f", lineterminator="\n")
        rows = pd.DataFrame(mesh.normals())
        rows.insert(0, "tag", "vn")
        rows.to_csv(file, sep=" ", header=False, index=False, float_format="%.4f", lineterminator="\n")
        file.write("s 1\n")
        corners = (mesh.faces + 1).astype(str)
        np.savetxt(file, np.char.add(np.char.add(corners, "//"), corners), fmt="f %s %s %s")
