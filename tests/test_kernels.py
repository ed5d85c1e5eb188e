"""The cache of compiled kernels depends on the code of called kernels."""

import subprocess
import sys
from pathlib import Path

import pytest

import polarsim

INNER = "from polarsim.kernels import njit\n\n@njit()\ndef inner(x):\n    return x + {number}\n"
OUTER = (
    "from polarsim.kernels import njit\nfrom polarsim.inner import inner\n\n"
    "@njit()\ndef outer(x):\n    return inner(x)\n"
)
ASK = "from polarsim.outer import outer; print(outer(1), sum(outer.stats.cache_hits.values()))"


@pytest.fixture
def library(tmp_path: Path) -> Path:
    """A library of two kernels; the outer kernel calls the inner kernel."""
    package = tmp_path / "polarsim"
    package.mkdir()
    (package / "__init__.py").touch()
    for name in ("kernels.py", "digest.py"):
        (package / name).write_text((Path(polarsim.__file__).parent / name).read_text())
    (package / "inner.py").write_text(INNER.format(number=1))
    (package / "outer.py").write_text(OUTER)
    return tmp_path


def asked(library: Path) -> list[int]:
    """Return the result of the outer kernel for 1 and the number of cache hits."""
    done = subprocess.run([sys.executable, "-c", ASK], cwd=library, capture_output=True, text=True, check=True)
    return [int(word) for word in done.stdout.split()]


def test_an_edit_of_a_called_kernel_repeats_the_compilation(library):
    assert asked(library) == [2, 0]
    assert asked(library) == [2, 1]
    (library / "polarsim/inner.py").write_text(INNER.format(number=10))
    assert asked(library) == [11, 0]
