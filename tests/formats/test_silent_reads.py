"""Damaged files that earlier versions read without an error."""

import re

import numpy as np
import pandas as pd
import pytest

from polarsim.errors import FormatError
from polarsim.formats import obj, png, tables, yolo
from polarsim.geometry.stereo import default_rig
from polarsim.run_files import lamps, rigs, rock_translations, scene


def test_a_png_with_a_wrong_checksum_is_an_error(tmp_path):
    content = bytearray(png.encode_png(np.arange(192, dtype=np.uint16).reshape(12, 16)))
    content[-20] ^= 1
    (tmp_path / "a.png").write_bytes(content)
    with pytest.raises(FormatError, match=r"a\.png"):
        png.read_png(tmp_path / "a.png")


def test_a_polygon_without_decimal_point_is_an_error(tmp_path):
    (tmp_path / "a.txt").write_text("2 030992 0.17 0.05 0.17 0.05 0.19\n")
    with pytest.raises(FormatError, match=r"a\.txt"):
        yolo.read_polygons(tmp_path / "a.txt")


def test_a_lamp_at_infinity_is_an_error(tmp_path):
    (tmp_path / lamps.FILE).write_text('{"30": [1e999, 0, 1]}')
    with pytest.raises(FormatError, match=r"lamps\.json"):
        lamps.read_localised_suns(tmp_path)


def test_a_translation_without_a_number_is_an_error(tmp_path):
    (tmp_path / rock_translations.FILE).write_text(",".join(rock_translations.COLUMNS) + "\n3,,2,3,4,5,6,7\n")
    with pytest.raises(FormatError, match=r"rock_translations\.csv"):
        rock_translations.read_translations(tmp_path)


def test_a_mesh_without_origin_is_an_error(tmp_path):
    (tmp_path / scene.MESH_TABLE).write_text("mesh,made_from\nterrain01_rock3.obj,\n")
    with pytest.raises(FormatError, match=r"meshes\.csv"):
        scene.mesh_origins(tmp_path)


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


def test_a_relative_vertex_number_before_the_first_vertex_is_an_error(tmp_path):
    (tmp_path / "a.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 -9\n")
    with pytest.raises(FormatError, match=r"a\.obj"):
        obj.read_obj(tmp_path / "a.obj")
