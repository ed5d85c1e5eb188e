"""Identity notes: a hidden file next to an output with the digest of all inputs of the output.

A repeated call writes an output again only if its identity has changed: input files, options or code.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path

from polarsim.digest import code_digest
from polarsim.formats.files import write_text


def digest(files: Iterable[Path], *words: str) -> str:
    """Return the SHA-256 of names and contents of files, and of words."""
    found = hashlib.sha256("\n".join(words).encode())
    for file in files:
        found.update(f"\n{file.name}\n".encode())
        found.update(file.read_bytes())
    return found.hexdigest()


def identity(module: str, files: Iterable[Path], *words: str) -> str:
    """Return the identity of an output that a module computes from files and options."""
    return digest(files, code_digest(module), *words)


def is_current(output: Path, wanted: str) -> bool:
    """Return whether an output is complete and was made with the wanted identity."""
    note = _note(output)
    return output.is_file() and note.is_file() and note.read_text(encoding="utf-8") == wanted


@contextmanager
def store_identity(output: Path, made_with: str) -> Iterator[None]:
    """Store the identity of the output that the block writes; after an error no identity is stored."""
    _note(output).unlink(missing_ok=True)
    yield
    write_text(_note(output), made_with)


def _note(output: Path) -> Path:
    return output.with_name(f".{output.name}.identity")
