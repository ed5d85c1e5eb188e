import subprocess
import sys

import pytest

SCRIPT = """
import sys
from pathlib import Path

from numba.core.dispatcher import Dispatcher

from polarsim.cli.demo_views import render_demo
from polarsim.render.first_use import compile_kernels
from polarsim.tone import to_8bit

def compiled():
    kernels = (value for name, module in list(sys.modules.items()) if name.startswith("polarsim")
               for value in vars(module).values() if isinstance(value, Dispatcher))
    return {(kernel.py_func.__qualname__, str(types)) for kernel in kernels for types in kernel.signatures}

compile_kernels()
first = compiled()
render_demo(Path(sys.argv[1]), tone=to_8bit, scale=1.0, threads=1)
print(len(first), sorted(compiled() - first))
"""


@pytest.mark.slow
def test_renderings_use_the_compiled_kernels_only(tmp_path):
    script = [sys.executable, "-c", SCRIPT, str(tmp_path / "demo")]
    run = subprocess.run(script, capture_output=True, text=True, check=True)
    count, later = run.stdout.split(maxsplit=1)
    assert int(count) > 10
    assert later.strip() == "[]"
