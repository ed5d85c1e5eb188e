"""Every reader of text decodes files in the same way."""

import codecs
import json
from functools import partial

import numpy as np
import pytest

from polarsim.errors import PolarsimError
from polarsim.formats import class_lists, nasa, obj, tables, yolo
from polarsim.formats.calibrations import read_calibration
from polarsim.formats.clouds import read_cloud
from polarsim.formats.files import read_json
from polarsim.formats.yaml_files import read_yaml
from polarsim.rocks.overrides import read_overrides
from polarsim.site import polar
from tests.support.polar_photos import SIZE
from tests.support.polar_rig import default_rig

UNICODE = ("utf-8", "utf-8-sig", "utf-16", "utf-32", "utf-16-le-mark", "utf-16-be-mark")


def encoded(text: str, encoding: str) -> bytes:
    if encoding.endswith("-mark"):
        return ("\ufeff" + text).encode(encoding.removesuffix("-mark"))
    return text.encode(encoding)


def calibration(folder) -> str:
    nasa.write_calibration(folder / "plain", default_rig())
    return "# Kalibrierung fürs Gelände\n" + (folder / "plain").read_text()


READERS = {  # file name, text, reader
    "boxes": ("a.txt", lambda _: "0 0.5 0.5 0.1 0.1\n1 0.2 0.2 0.1 0.1\n", partial(yolo.read_boxes, size=SIZE)),
    "detections": ("a.txt", lambda _: "0 0.5 0.5 0.1 0.1 0.25\n", partial(yolo.read_detections, size=SIZE)),
    "polygons": ("a.txt", lambda _: "0 0.1 0.1 0.2 0.1 0.2 0.2\n", partial(yolo.read_polygons, size=SIZE)),
    "classes": (
        "classes.txt",
        lambda _: "rock\nshadow\nKrater für später\n",
        lambda p: class_lists.class_names(p.parent),
    ),
    "mesh": ("a.obj", lambda _: "o Würfel\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n", obj.read_obj),
    "cloud": ("a.xyz", lambda _: "# Höhe\n1 2 3\n4 5 6\n", read_cloud),
    "calibration": ("stereo.calibration", calibration, lambda path: read_calibration(path, polar())),
    "yaml": ("a.yaml", lambda _: "# größer\nname: Würfel\nsize: [1, 2]\n", read_yaml),
    "overrides": ("a.yaml", lambda _: "# größer\n- {rock: 900, at: [1, 2]}\n", read_overrides),
    "json": ("a.json", lambda _: json.dumps({"name": "Würfel"}, ensure_ascii=False), read_json),
    "csv": ("a.csv", lambda _: "key,name\na,Würfel\n", tables.read_csv),
}


def plain(found: object) -> object:
    """Return the result of a reader in a form that can be compared with `==`."""
    if isinstance(found, np.ndarray):
        return found.tolist()
    if isinstance(found, (list, tuple)):
        return [plain(part) for part in found]
    return repr(found)


@pytest.mark.parametrize("name", READERS)
def test_every_reader_of_text_reads_every_encoding(tmp_path, name):
    file, make, read = READERS[name]
    text = make(tmp_path)
    path = tmp_path / file
    found = {}
    for encoding in (*UNICODE, "latin-1"):
        for end in ("\n", "\r\n"):
            path.write_bytes(encoded(text.replace("\n", end), encoding))
            found[encoding, end] = plain(read(path))
    assert len({str(one) for one in found.values()}) == 1, found


@pytest.mark.parametrize("name", READERS)
@pytest.mark.parametrize("content", [b"\0\1\2\3" * 20, codecs.BOM_UTF16_LE + b"1", b"PK\3\4\0\0" * 9])
def test_binary_content_is_a_one_line_error(tmp_path, name, content):
    file, _, read = READERS[name]
    (tmp_path / file).write_bytes(content)
    with pytest.raises(PolarsimError) as caught:
        read(tmp_path / file)
    assert caught.value.path == tmp_path / file
    assert "\n" not in str(caught.value)
