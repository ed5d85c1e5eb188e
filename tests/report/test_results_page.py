import base64
import io
import os
import re

import numpy as np
import pandas as pd
import pytest
from PIL import Image

from polarsim import __version__
from polarsim.errors import PolarsimError
from polarsim.formats import png
from polarsim.formats.files import write_json, write_text
from polarsim.formats.tables import write_csv, write_parquet
from polarsim.report.results_page import PageFiles, RunFacts, picture_counts, write_results_page

ORIGIN = {"run": "demo", "source": "analog", "config": "1a2b3c4d"}
SCORES = pd.DataFrame(
    [["real", "real", "rock", "photo", 0, 0.457, 0.405, 0.535, "view", 16]],
    columns=["trained", "evaluated", "kind", "split", "seed", "map50", "map50_low", "map50_high", "unit", "units"],
)
TABLE = "**Detection & more**\n\n| T | E: Analog |\n| --- | ---: |\n| Analog | 0.5 \\| 0.4 <x> |\n\nA note.\n"


@pytest.fixture
def run(tmp_path):
    """Files of a run without stereo and without the ablation, as they lie below results/demo."""
    write_parquet(tmp_path / "photos.parquet", pd.DataFrame({"key": [f"photo {number}" for number in range(1234)]}))
    write_json(tmp_path / "figures/strip/strip.json", {"key": "01_A_off_30_L_0256", "panels": [["photo", "A <photo>"]]})
    png.write(tmp_path / "figures/strip/photo.png", np.zeros((4, 4), "uint8"))
    dataset = tmp_path / "datasets" / "real"
    dataset.mkdir(parents=True)
    write_json(dataset / "dataset.json", {"pictures": {"train": 7, "val": 1, "test": 3}})
    tables = {}
    for name in ("detection", "ipd", "differences", "detection_breakdown", "false_positives"):
        tables[name] = tmp_path / f"tables/{name}.md"
        write_text(tables[name], TABLE.replace("Detection", name))
        write_csv(
            tables[name].with_suffix(".csv"),
            SCORES if name == "detection" else SCORES[:0].assign(ipd=[], first=[], second=[]),
        )
    figures = {}
    for name in ("comparison_Terrain01_PosA", "detection", "seen_real", "seen_hapke", "opposition"):
        figures[name] = tmp_path / f"figures/{name}.png"
        png.write(figures[name], np.zeros((4, 4), "uint8"))
    phases = tmp_path / "figures/opposition.json"
    write_json(phases, {"shown": True, "text": "From 2 to 90 degrees"})
    return {
        "tables": tables, "figures": figures, "phases": [phases], "datasets": {("photo", "real"): dataset},
        "strip": tmp_path / "figures/strip", "photos": tmp_path / "photos.parquet",
    }  # fmt: skip


def written(folder, run):
    facts = RunFacts(ORIGIN, [1, 11], ["A"], ["hapke"], "real", {"report.html": "Snakemake's report"})
    write_results_page(files=PageFiles(**run), run=facts, page=folder / "results.html")
    return (folder / "results.html").read_text()


def test_the_page_holds_every_table_and_picture_of_the_run_and_needs_no_other_file(tmp_path, run):
    page = written(tmp_path, run)
    assert set(re.findall(r"<strong>(\w+) &amp; more", page)) == set(run["tables"])
    assert re.findall(r'<figure id="(\w+)"', page) == [
        "comparison_Terrain01_PosA", "detection", "seen_real", "seen_hapke", "opposition",
    ]  # fmt: skip
    assert set(re.findall(r'src="(data:image/\w+)', page)) == {"data:image/webp"}
    assert len(re.findall(r'src="data:', page)) == 1 + 2 * len(run["figures"])  # the strip, in the text, in the list
    assert not re.search(r'src="(?!data:)', page)
    assert "the detector trained on Analog" in page  # images of the analog are never named real
    assert "0.5 | 0.4 &lt;x&gt;" in page
    assert "none of these numbers is one of NASA" in page
    assert "From 2 to 90 degrees." in page


def test_every_link_leads_to_a_part_of_the_page_or_to_a_file_beside_it(tmp_path, run):
    page = written(tmp_path, run)
    links = set(re.findall(r'href="([^"]+)"', page)) - {"report.html"}  # which is made of this page, too
    assert {"tables/ipd.csv", "tables/ipd.md", "figures/detection.png", "figures/strip/photo.png"} <= links
    ids = set(re.findall(r'id="([^"]+)"', page))
    assert all(link[1:] in ids if link.startswith("#") else (tmp_path / link).is_file() for link in links)


def test_readers_of_the_screen_find_the_main_part_and_every_link(tmp_path, run):
    """As axe asks of the page: all of it is in one landmark, and what opens a table holds no link of its own."""
    page = written(tmp_path, run)
    (main,) = re.findall(r"<body><main>(.*)</main>", page, re.DOTALL)
    summaries = re.findall(r"<summary>(.*?)</summary>", main)
    assert len(summaries) == len(run["tables"])
    assert not any("<" in summary for summary in summaries)
    assert len(re.findall(r'<a href="tables/\w+\.csv">csv</a>', main)) == len(run["tables"])


def test_the_first_screen_says_what_the_run_is_and_its_metrics_with_intervals(tmp_path, run):
    first = written(tmp_path, run).partition("<h2>")[0]
    for fact in ("demo", "analog", "01, 11 (positions A)", "1,234", "hapke", "1a2b3c4d", __version__):
        assert fact in first
    assert "<strong>0.46</strong>[0.41 to 0.54]" in first
    assert "trained on Analog" in first
    assert "A &lt;photo&gt;" in first


def test_pictures_are_small_and_the_same_files_make_the_same_page_whenever_they_were_made(tmp_path, run):
    grain = np.random.default_rng(0).integers(0, 256, (600, 2400), "uint8")
    png.write(run["figures"]["detection"], grain)
    page = written(tmp_path, run)
    content = base64.b64decode(re.search(r'id="detection".*?base64,([^"]+)"', page)[1])
    assert Image.open(io.BytesIO(content)).size == (1100, 275)
    for path in [*run["tables"].values(), *run["figures"].values()]:
        os.utime(path, (10**9, 10**9))
    assert written(tmp_path, run) == page


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
