"""Small files that ask for much: refused in one line, soon, in little memory. Run as a program this is the child."""

import json
import resource
import struct
import subprocess
import sys
import time
import zipfile
import zlib
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from polarsim.acquire import archives
from polarsim.errors import PolarsimError
from polarsim.formats import coco, files, nasa, npz, obj, png, tables, yaml_files

MOST_MB, MOST_S = 300, 10  # beside what is imported; a second on a machine that does nothing else
ROOM = 1 << 30  # bytes of addresses that the child may take beside what it has


def png_bomb(path):
    def chunk(kind, content):
        return struct.pack(">I", len(content)) + kind + content + struct.pack(">I", zlib.crc32(kind + content))

    header = struct.pack(">IIBBBBB", 30_000, 30_000, 16, 0, 0, 0, 0)
    zeros = zlib.compress(bytes(60_001))
    path.write_bytes(b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", header) + chunk(b"IDAT", zeros) + chunk(b"IEND", b""))


def tiff_bomb(path, width=30_000, height=30_000, bands=3):
    """The tags of a small picture say that it is a large one."""
    import tifffile

    tifffile.imwrite(
        path, np.zeros((12, 16, 3), np.float32), photometric="minisblack", planarconfig="contig", metadata=None
    )
    with tifffile.TiffFile(path, mode="r+") as tiff:
        tags = tiff.pages[0].tags
        for name, value in (("ImageWidth", width), ("ImageLength", height), ("SamplesPerPixel", bands)):
            tags[name].overwrite(value)


def zip_of_many(path):
    """Each of the entries is harmless alone."""
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        for number in range(40):
            archive.writestr(f"{number}.txt", bytes(1_000_000))


def laughs(path):
    levels = [f"a{n}: &a{n} [{', '.join([f'*a{n - 1}'] * 9)}]" for n in range(1, 10)]
    path.write_text("\n".join(["a0: &a0 [lol]", *levels]) + "\n")


def many_aliases(path):
    path.write_text("a: &a [1]\nb: [" + "*a, " * 1_000_000 + "]\n")


def parquet_that_lies(path, columns=1):
    """A column of the same value packs well, and its footer says that it has 60 times as many."""
    rows = 2_000_003
    table = pd.DataFrame({str(number): np.zeros(rows) for number in range(columns)})
    table.to_parquet(path, compression="zstd", row_group_size=rows)
    said, lie = (bytes(_varint(2 * number)) for number in (rows, 130_000_001))
    content = path.read_bytes()
    assert content.count(said) >= 2
    assert len(said) == len(lie)
    path.write_bytes(content.replace(said, lie))


def _varint(number):
    while number > 127:
        yield number & 127 | 128
        number >>= 7
    yield number


def npz_bomb(path):
    header = b"{'descr': '<f8', 'fortran_order': False, 'shape': (1000000000000,), }".ljust(117) + b"\n"
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("level.npy", b"\x93NUMPY\x01\x00" + struct.pack("<H", len(header)) + header + bytes(80))


def sparse(path):
    with path.open("wb") as file:
        file.write(b'{"images": [')
        file.truncate(2_000_000_000)


def write(content):
    return lambda path: path.write_text(content)


TRAPS = {
    "a.png": (png_bomb, png.read, "30000 x 30000 pixels"),
    "b.tif": (tiff_bomb, png.read, "30000 x 30000 pixels"),
    "c.tif": (tiff_bomb, nasa.read_range_map, "30000 x 30000 x 3, expected 1216 rows"),
    "d.tif": (lambda path: tiff_bomb(path, 1936, 1216, 5000), nasa.read_range_map, "1216 x 1936 x 5000, expected"),
    "e.zip": (zip_of_many, lambda path: archives.unpack(path, path.with_suffix("")), "unpacks to 40 MB, more than 200"),
    "f.yaml": (laughs, yaml_files.read_yaml, "more than 200000 values"),
    "g.yaml": (many_aliases, yaml_files.read_yaml, "4 MB, no file of this kind has more than 1 MB"),
    "h.yaml": (write("a: &a [" + "*a, " * 200_000 + "]"), yaml_files.read_yaml, ""),
    "i.yaml": (write("[" * 100_000), yaml_files.read_yaml, "more than 50 deep"),
    "s.yaml": (write("a: &a [*a]"), yaml_files.read_yaml, "more than 200000 values"),
    "j.json": (write("[" * 1_000_000), files.read_json, "recursion"),
    "k.obj": (write("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 1000000000\n"), obj.read, "names vertex 1000000000 of 3"),
    "l.obj": (write("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 -1000000000\n"), obj.read, "names vertex"),
    "m.obj": (write("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 1" + "0" * 30 + "\n"), obj.read, "no readable OBJ file"),
    "n.parquet": (parquet_that_lies, tables.read_parquet, "no readable Parquet table"),
    "r.parquet": (lambda path: parquet_that_lies(path, 2), tables.read_parquet, "130000001 rows of 2 columns"),
    "o.npz": (npz_bomb, lambda path: npz.read_arrays(path, ()), "no readable NPZ file"),
    "p.json": (sparse, coco.read_coco, "2000 MB, no file of this kind has more than 500 MB"),
    "q.json": (write('{"images": [], "categories": [{"id": 1, "name": "' + "x" * 10_000_000), coco.read_coco, ""),
}


def main(folder):
    """Read every trap; what came of it, s, and MB that it took beyond what was taken before."""
    taken = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
    resource.setrlimit(resource.RLIMIT_AS, (taken + ROOM, taken + ROOM))
    for name, (_, read, _) in TRAPS.items():
        before, start = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss, time.perf_counter()
        try:
            read(Path(folder, name))
            said = ""
        except PolarsimError as error:
            said = str(error)
        spent, grown = time.perf_counter() - start, resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before
        print(json.dumps([name, said, spent, grown / 1e3]), flush=True)


@pytest.fixture(scope="module")
def outcomes(tmp_path_factory):
    """All in one child: Python and its libraries are started once."""
    folder = tmp_path_factory.mktemp("traps")
    for name, (make, _, _) in TRAPS.items():
        make(folder / name)
    child = subprocess.run([sys.executable, __file__, folder], capture_output=True, text=True, timeout=300)
    assert child.returncode == 0, child.stdout + child.stderr
    yield {name: (said, spent, grown) for name, said, spent, grown in map(json.loads, child.stdout.splitlines())}
    (folder / "p.json").unlink()


@pytest.mark.parametrize("name", TRAPS)
def test_a_trap_is_refused_in_one_line_soon_and_in_little_memory(outcomes, name):
    said, spent, grown = outcomes[name]
    assert f"{name}:" in said
    assert TRAPS[name][2] in said
    assert len(said.splitlines()) == 1
    assert len(said) < 1000
    assert spent < MOST_S
    assert grown < MOST_MB


if __name__ == "__main__":
    main(sys.argv[1])
