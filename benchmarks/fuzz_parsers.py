"""Our own parsers under atheris, which looks for inputs that reach new code: nothing but a `PolarsimError` may come.

.venv/bin/pip install '.[fuzz]'; .venv/bin/python -m benchmarks.fuzz_parsers [--seconds 300]
Each parser runs in a process of its own, from the inputs of `benchmarks/fuzz_corpus/PARSER/`; an input that breaks one
is named. Only code in Python tells atheris what an input reached, so parsers of libraries are left to `fuzz.py`.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
import tempfile
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any

CORPUS = Path(__file__).with_name("fuzz_corpus")


def parsers() -> dict[str, Callable[[Path], Any]]:
    """By name; imported where atheris has prepared the import."""
    from polarsim.formats import nasa, obj, png, rle, yaml_files, yolo

    return {
        "boxes": yolo.read_boxes_or_polygons,
        "detections": yolo.read_detections,
        "obj": obj.read,
        "calibration": nasa.read_calibration,
        "cloud": lambda path: nasa.read_cloud(path.with_suffix(".xyz")),
        "png_header": lambda path: png.parse_header(path.read_bytes()),
        "runs": lambda path: rle.from_text(path.read_text("latin-1"), (30, 20)).mask(),
        "yaml": lambda path: yaml_files.parse_yaml(path.read_text("latin-1")),
    }


def parse(name: str, content: bytes, folder: Path) -> None:
    """Give a parser some bytes as a file; what is no `PolarsimError` comes through."""
    import yaml

    from polarsim.errors import PolarsimError

    for path in (folder / "input", folder / "input.xyz"):
        path.unlink(missing_ok=True)  # ext4 writes a file that was shortened and filled again to the disk at once
        path.write_bytes(content)
    with suppress(PolarsimError, yaml.YAMLError):
        parsers()[name](folder / "input")


def hunt(name: str, seconds: int) -> None:
    """Never returns: atheris ends the process."""
    import atheris

    with atheris.instrument_imports(include=["polarsim"]):
        parsers()
    folder = Path(tempfile.mkdtemp())
    found = folder / "found"
    found.mkdir()
    atheris.Setup([sys.argv[0], f"-max_total_time={seconds}", "-timeout=5", "-rss_limit_mb=1500",
                   f"-artifact_prefix={name}-", str(found), str(CORPUS / name)],
                  lambda content: parse(name, content, folder))  # fmt: skip
    atheris.Fuzz()


def main() -> int:
    parser = argparse.ArgumentParser(description="Our own parsers under atheris.")
    parser.add_argument("--seconds", type=int, default=300, help="for each parser")
    parser.add_argument("--one", help="this parser alone, in this process")
    given = parser.parse_args()
    if given.one:
        hunt(given.one, given.seconds)
    call = [sys.executable, "-m", "benchmarks.fuzz_parsers", "--seconds", str(given.seconds), "--one"]
    broken = [name for name in parsers() if subprocess.run([*call, name]).returncode]
    print("broken:", ", ".join(broken) or "none")
    return min(len(broken), 1)


if __name__ == "__main__":
    sys.exit(main())
