import base64
import io
import re

import numpy as np
import pytest
from PIL import Image

from polarsim.errors import PolarsimError
from polarsim.formats import png
from polarsim.formats.files import write_json
from polarsim.report.results_page import picture_counts, write_results_page

ORIGIN = {"run": "demo", "source": "analog", "config": "1a2b3c4d"}
TABLE = "**Detection & more**\n\n| T | E: Analog |\n| --- | ---: |\n| Analog | 0.5 \\| 0.4 <x> |\n\nA note.\n"


@pytest.fixture
def run(tmp_path):
    """Files of a run without stereo and without the ablation."""
    dataset = tmp_path / "datasets" / "real"
    dataset.mkdir(parents=True)
    write_json(dataset / "dataset.json", {"pictures": {"train": 7, "val": 1, "test": 3}})
    tables = {}
    for name in ("detection", "ipd", "differences", "detection_breakdown", "false_positives"):
        tables[name] = tmp_path / f"{name}.md"
        tables[name].write_text(TABLE.replace("Detection", name))
    figures = {}
    for name in ("comparison_Terrain01_PosA", "detection", "seen_real", "seen_hapke", "opposition"):
        figures[name] = tmp_path / f"{name}.png"
        png.write(figures[name], png.np.zeros((4, 4), "uint8"))
    phases = tmp_path / "opposition.json"
    write_json(phases, {"shown": True, "text": "From 2 to 90 degrees"})
    return {"tables": tables, "figures": figures, "phases": [phases], "datasets": {("photo", "real"): dataset}}


def written(folder, run):
    write_results_page(**run, page=folder / "results.html", origin=ORIGIN)
    return (folder / "results.html").read_text()


def test_the_page_holds_every_table_and_picture_of_the_run_and_needs_no_other_file(tmp_path, run):
    page = written(tmp_path, run)
    assert set(run["tables"]) <= set(re.findall(r"<strong>(\w+) &amp; more", page))
    assert re.findall(r'<figure id="(\w+)"', page) == [
        "comparison_Terrain01_PosA", "detection", "seen_real", "seen_hapke", "opposition",
    ]  # fmt: skip
    assert len(re.findall(r'src="data:image/', page)) == len(run["figures"])
    assert not re.search(r'(src|href)="(?!data:)', page)
    assert "trained on Analog finds" in page  # what the analog made is never called real
    assert "0.5 | 0.4 &lt;x&gt;" in page
    assert "none of these numbers is one of NASA" in page
    assert "From 2 to 90 degrees." in page


def test_photos_are_embedded_as_jpeg_of_quality_88(tmp_path, run):
    grain = np.random.default_rng(0).integers(0, 256, (64, 64), "uint8")
    png.write(run["figures"]["detection"], grain)
    content = base64.b64decode(re.search(r'id="detection".*?base64,([^"]+)"', written(tmp_path, run))[1])
    assert Image.open(io.BytesIO(content)).quantization[0][0] == 4  # 16 at 50, 8 at PIL's own 75


def test_what_a_run_has_not_has_no_heading(tmp_path, run):
    page = written(tmp_path, run)
    assert "Stereo depth" not in page
    assert "Causes of the gap" not in page
    write_json(run["phases"][0], {"shown": False, "text": "No photo shows it"})
    assert "Opposition" not in written(tmp_path, run)


def test_pictures_are_counted_by_split_and_domain(run):
    assert picture_counts(run["datasets"], "polar").to_numpy().tolist() == [["photo", "Real", 7, 1, 3]]


def test_a_missing_data_set_is_named_and_no_page_is_written(tmp_path, run):
    (run["datasets"]["photo", "real"] / "dataset.json").unlink()
    with pytest.raises(PolarsimError, match=r"dataset\.json"):
        written(tmp_path, run)
    assert not (tmp_path / "results.html").exists()
