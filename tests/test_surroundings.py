"""Locale, time zone, hash seed and working folder change no output of a command."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

from tests.support.polar_photos import HEIGHT, WIDTH

CHECKOUT = Path(__file__).parents[1]
KEY = "03_A_off_30_L_0256"
CVAT = f"""<?xml version="1.0" encoding="utf-8"?>
<annotations><version>1.1</version>
<image id="0" name="Gr\u00f6\u00dfe/{KEY}.png" width="{WIDTH}" height="{HEIGHT}">
<box label="rock" xtl="100.5" ytl="200.25" xbr="180" ybr="260" occluded="0" z_order="0"/>
<box label="shadow" xtl="180" ytl="210" xbr="300" ybr="250" occluded="0" z_order="0"/>
</image></annotations>
"""
PROGRAM = """
import sys
from polarsim.cli import main
out, source, truth = sys.argv[1:]
for words in (
    ["import", source, out + "/imported"],
    ["score", truth, out + "/imported", "--json", out + "/score.json"],
    ["validate", truth, "--fix", out + "/fixed", "--json", out + "/findings.json"],
):
    sys.argv = ["polarsim", *words]
    try:
        main()
    except SystemExit as ended:
        assert ended.code in (0, 1, None), (words, ended.code)
"""
SURROUNDINGS = {
    "ASCII locale": {"LC_ALL": "C", "PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0"},
    "other locale, time zone and hash seed": {"LC_ALL": "tr_TR.UTF-8", "TZ": "Asia/Kathmandu", "PYTHONHASHSEED": "7"},
}


def outputs(tmp_path: Path, environment: dict[str, str], folder: Path) -> dict[str, bytes]:
    """Return the outputs of the commands by path, for a working folder and an environment."""
    out = tmp_path / "out"
    shutil.rmtree(out, ignore_errors=True)
    out.mkdir()
    done = subprocess.run(
        [sys.executable, "-c", PROGRAM, str(out), str(tmp_path / "gr\u00f6\u00dfe.xml"), str(tmp_path / "truth")],
        cwd=folder, capture_output=True, text=True, check=False,
        env={**os.environ, "PYTHONPATH": str(CHECKOUT), **environment},
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    files = {path.relative_to(out).as_posix(): path.read_bytes() for path in sorted(out.rglob("*")) if path.is_file()}
    assert {f"imported/{KEY}.txt", "score.json", "findings.json", "fixed/changes.csv"} <= set(files)
    return files


def test_surroundings_change_no_output(tmp_path):
    (tmp_path / "gr\u00f6\u00dfe.xml").write_text(CVAT, encoding="utf-8")
    labels = tmp_path / f"truth/Labels/Terrain03/{KEY}.txt"
    labels.parent.mkdir(parents=True)
    labels.write_text("0 0.07 0.19 0.04 0.05\n1 0.124 0.19 0.06 0.03\n1 0.124 0.19 0.06 0.03\n")
    (tmp_path / "elsewhere").mkdir()
    plain = outputs(tmp_path, {}, tmp_path)
    for name, environment in SURROUNDINGS.items():
        assert outputs(tmp_path, environment, tmp_path / "elsewhere") == plain, name
