"""Damaged files that earlier versions read without an error."""

import json
import re
from functools import partial

import numpy as np
import pandas as pd
import pytest

from polarsim.errors import FormatError
from polarsim.formats import png, tables, yolo
from polarsim.run_files import lamps, rigs, rock_translations, scene
from tests.support.polar_photos import SIZE
from tests.support.polar_rig import default_rig


def wrong_checksum() -> bytes:
    content = bytearray(png.encode_png(np.arange(192, dtype=np.uint16).reshape(12, 16)))
    content[-20] ^= 1
    return bytes(content)


@pytest.mark.parametrize(
    ("name", "content", "read"),
    [
        ("a.png", wrong_checksum(), png.read_png),
        (
            "a.txt",
            b"2 030992 0.17 0.05 0.17 0.05 0.19\n",
            partial(yolo.read_polygons, size=SIZE),
        ),  # a decimal point is missing
        (lamps.FILE, json.dumps({"30": [1e999, 0, 1]}).encode(), lambda path: lamps.read_localised_suns(path.parent)),
        (
            rock_translations.FILE,
            (",".join(rock_translations.COLUMNS) + "\n3,,2,3,4,5,6,7\n").encode(),
            lambda path: rock_translations.read_translations(path.parent),
        ),
        (
            scene.MESH_TABLE,
            b"mesh,made_from\nterrain01_rock3.obj,\n",
            lambda path: scene.mesh_origins(path.parent),
        ),
    ],
)
def test_a_damaged_file_is_an_error(tmp_path, name, content, read):
    (tmp_path / name).write_bytes(content)
    with pytest.raises(FormatError) as caught:
        read(tmp_path / name)
    assert caught.value.path == tmp_path / name


@pytest.mark.parametrize("text", ['"fx_px": -2', '"fx_px": 1e999', '"width_px": 0', '"width_px": 99999999'])
def test_an_impossible_lens_is_an_error(tmp_path, text):
    rigs.write_rig(tmp_path / "a.json", default_rig(), "stated")
    good = (tmp_path / "a.json").read_text()
    (tmp_path / "a.json").write_text(re.sub(text.split(":")[0] + r": [\d.]+", text, good, count=1))
    with pytest.raises(FormatError, match=r"a\.json"):
        rigs.read_rig(tmp_path / "a.json")


def test_an_invalid_text_is_an_error_when_the_table_is_read(tmp_path):
    pd.DataFrame({"key": ["rock"]}).to_parquet(tmp_path / "a.parquet", compression=None)
    content = (tmp_path / "a.parquet").read_bytes()
    (tmp_path / "a.parquet").write_bytes(content.replace(b"rock", b"r\x80ck", 1))
    with pytest.raises(FormatError, match=r"a\.parquet"):
        tables.read_parquet(tmp_path / "a.parquet")
