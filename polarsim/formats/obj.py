"""OBJ meshes in the form of the release: metres, sandbox frame, triangles, vertex normals, no material."""

from __future__ import annotations

import codecs
import io
import re
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from polarsim.errors import FormatError
from polarsim.formats.files import lines_of, writing
from polarsim.formats.mesh_names import GROUND_PATTERN as GROUND_PATTERN
from polarsim.formats.mesh_names import ground_name as ground_name
from polarsim.formats.mesh_names import parse_rock_name as parse_rock_name
from polarsim.formats.mesh_names import rock_files as rock_files
from polarsim.formats.mesh_names import rock_name as rock_name
from polarsim.formats.readers import reader
from polarsim.geometry.meshes import Mesh


@reader("OBJ file", largest_mb=2000)
def read_obj(path: str | Path) -> Mesh:
    """Return vertices and triangles of an OBJ file; polygons are cut into fans, other lines are ignored."""
    content = Path(path).read_bytes().removeprefix(codecs.BOM_UTF8)
    mesh = _plain_triangles(content) or _any_faces(content)
    if not len(mesh.faces):
        raise FormatError("no triangle, expected lines such as `f 1 2 3`")
    outside = mesh.faces[mesh.faces >= len(mesh.vertices)]
    if len(outside):
        raise FormatError(f"a face refers to vertex {outside[0] + 1} of {len(mesh.vertices)}")
    if not np.isfinite(mesh.vertices).all():
        raise FormatError("a vertex is not finite")
    return mesh


def _plain_triangles(content: bytes) -> Mesh | None:
    """Read a file with a block of vertices and a block of triangles in vectorised form; None for all other files."""
    vertices, faces = _block(content, b"v "), _block(content, b"f ")
    if vertices is None or faces is None or not _is_plain(content, vertices, faces):
        return None
    coordinates = _columns(content[vertices], float, (1, 2, 3), of=4)
    lines = content[faces]
    if coordinates is None or b"x" in lines:  # Arrow reads hexadecimal numbers
        return None
    # A corner is the number of a vertex, optionally followed by texture and normal, as in `f 1//1 2//2 3//3`.
    step = {0: 1, 3: 2, 6: 3}.get(lines.count(b"/", 0, lines.find(b"\n")))  # fields per corner
    if step is None:
        return None
    corners = _columns(lines.replace(b"/", b" "), int, (1, 1 + step, 1 + 2 * step), of=1 + 3 * step)
    return Mesh(coordinates, corners - 1) if corners is not None and corners.min() > 0 else None


def _is_plain(content: bytes, *blocks: slice) -> bool:
    """Return whether all vertices and faces are inside the blocks, and no line is continued or ends with CR only."""
    if b"\\" in content and (b"\\\n" in content or b"\\\r" in content):
        return False
    if b"\r" in content and content.count(b"\r") != content.count(b"\r\n"):
        return False
    first, second = sorted(blocks, key=lambda block: block.start)
    rest = (slice(0, first.start), slice(first.stop, second.start), slice(second.stop, len(content)))
    return not any(re.search(rb"^(?:[ \t]|[vf]\t)", content[part], re.MULTILINE) for part in rest)


def _block(content: bytes, tag: bytes) -> slice | None:
    """Return the slice of all lines with a tag; None if there is no such line or if other lines are in between."""
    start = content.find(b"\n" + tag) + 1
    end = content.find(b"\n", content.rfind(b"\n" + tag) + 1) + 1
    if not 0 < start < end or content.startswith(tag):
        return None
    return slice(start, end) if content.count(b"\n" + tag, start - 1, end) == content.count(b"\n", start, end) else None


def _columns(block: bytes, kind: type[float] | type[int], chosen: tuple[int, ...], of: int) -> np.ndarray | None:
    """Return the chosen columns (n, len(chosen)) of a block in which each line has `of` fields separated by a space.

    Return None for other blocks.
    """
    try:
        import pyarrow
        from pyarrow import csv
    except ModuleNotFoundError:
        return _columns_numpy(block, kind, chosen, of)
    names = [str(column) for column in range(of)]
    chosen_names = [names[column] for column in chosen]
    try:
        table = csv.read_csv(
            pyarrow.BufferReader(block),
            csv.ReadOptions(use_threads=False, column_names=names),
            csv.ParseOptions(delimiter=" ", quote_char=False),
            csv.ConvertOptions(
                column_types=dict.fromkeys(chosen_names, pyarrow.float64() if kind is float else pyarrow.int64()),
                include_columns=chosen_names,
                null_values=[],
            ),
        )
    except pyarrow.ArrowInvalid:
        return None
    return np.stack([table[name].to_numpy() for name in chosen_names], axis=1)


def _columns_numpy(block: bytes, kind: type[float] | type[int], chosen: tuple[int, ...], of: int) -> np.ndarray | None:
    """Return what `_columns` returns, without Arrow."""
    characters = np.frombuffer(block, np.uint8)
    spaces = np.cumsum(characters == ord(" "))[characters == ord("\n")]
    if (np.diff(spaces, prepend=0) != of - 1).any():
        return None
    try:
        return np.loadtxt(io.BytesIO(block), kind, comments=None, delimiter=" ", usecols=chosen, ndmin=2)
    except ValueError:
        return None


def _any_faces(content: bytes) -> Mesh:
    """Read a file line by line: any notation, polygons, negative vertex numbers. Errors state the line."""
    vertices: list[list[float]] = []
    faces: list[list[int]] = []
    lines = lines_of(content)
    for number, line in _joined(lines) if b"\\" in content else enumerate(lines, 1):
        tag = line[:2]
        if tag[:1].isspace():
            line = line.lstrip()
            tag = line[:2]
        try:
            if tag in ("v ", "v\t"):
                x, y, z = _fields(line)[:3]
                vertices.append([float(x), float(y), float(z)])
            elif tag in ("f ", "f\t"):
                corners = [int(field.split("/", 1)[0]) for field in _fields(line)]
                if corners and min(corners) <= 0:
                    corners = [_counted(corner, len(vertices)) for corner in corners]
                faces += [[corners[0], corners[k], corners[k + 1]] for k in range(1, len(corners) - 1)]
        except ValueError as error:
            raise FormatError(str(error), line=number) from error
    return Mesh(np.array(vertices, float).reshape(-1, 3), np.array(faces, np.int64).reshape(-1, 3) - 1)


def _fields(line: str) -> list[str]:
    """Return the fields after the tag, without a comment."""
    numbers = line.partition("#")[0]
    if "_" in numbers or not numbers.isascii():  # Python accepts `1_000` and digits of other scripts
        raise ValueError(f"no number in {numbers.strip()!r}")
    return numbers.split()[1:]


def _joined(lines: list[str]) -> Iterator[tuple[int, str]]:
    """Yield line numbers from 1 and lines; a line that ends with a backslash is joined with the next line."""
    start, joined = 0, ""
    for number, line in enumerate(lines, 1):
        if line.endswith("\\"):
            start, joined = start or number, f"{joined}{line[:-1]} "
        elif start:
            yield start, joined + line
            start, joined = 0, ""
        else:
            yield number, line
    if start:
        yield start, joined


def _counted(corner: int, vertices: int) -> int:
    """Return the positive number of a vertex of a face; negative numbers are relative to the last vertex (-1)."""
    number = corner if corner > 0 else vertices + 1 + corner
    if corner == 0 or number < 1:
        raise ValueError(f"a face refers to vertex {corner} of {vertices}, expected a number from 1 or from -1 down")
    return number


def write_obj(path: str | Path, mesh: Mesh, name: str) -> None:
    """Write a mesh with vertex normals, rounded to micrometres. Equal meshes make equal bytes."""
    with writing(path) as temporary, temporary.open("w", encoding="ascii", newline="\n") as file:
        file.write(f"# polarsim, metres, sandbox frame\no {name}\n")
        for form, rows in (("v %.6f %.6f %.6f\n", mesh.vertices), ("vn %.4f %.4f %.4f\n", mesh.normals())):
            for block in _blocks(rows):
                file.write((form * len(block)) % tuple(block.ravel().tolist()))
        file.write("s 1\n")
        for block in _blocks(mesh.faces + 1):
            file.write(("f %d//%d %d//%d %d//%d\n" * len(block)) % tuple(np.repeat(block.ravel(), 2).tolist()))


def _blocks(rows: np.ndarray, length: int = 20_000) -> Iterator[np.ndarray]:
    """Yield blocks of rows, to bound the memory for the text of a large mesh."""
    return (rows[start : start + length] for start in range(0, len(rows), length))
