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
from polarsim.report.results_page import _html, picture_counts, write_results_page

ORIGIN = {"run": "demo", "source": "analog", "config": "1a2b3c4d"}
SCORES = pd.DataFrame(
    [["real", "real", "rock", "photo", 0, 0.457, 0.405, 0.535, "view", 16]],
    columns=["trained", "evaluated", "kind", "split", "seed", "map50", "map50_low", "map50_high", "unit", "units"],
)
TABLE = "**Detection & more**\n\n| T | E: Analog |\n| --- | ---: |\n| Analog | 0.5 \\| 0.4 <x> |\n\nA note.\n"


@pytest.fixture
def run(tmp_path):
    """Return the files of a run without stereo and ablation, with the layout of results/demo."""
    write_parquet(tmp_path / "photos.parquet", pd.DataFrame({"key": [f"photo {number}" for number in range(1234)]}))
    write_json(tmp_path / "figures/strip/strip.json", {"key": "01_A_off_30_L_0256", "panels": [["photo", "A <photo>"]]})
    png.write_png(tmp_path / "figures/strip/photo.png", np.zeros((4, 4), "uint8"))
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
        png.write_png(figures[name], np.zeros((4, 4), "uint8"))
    phases = tmp_path / "figures/opposition.json"
    write_json(phases, {"shown": True, "text": "From 2 to 90 degrees"})
    return {
        "tables": tables, "figures": figures, "phases": [phases], "datasets": {("photo", "real"): dataset},
        "strip": tmp_path / "figures/strip", "photos": tmp_path / "photos.parquet",
    }  # fmt: skip


def written(folder, run, site="polar", origin=ORIGIN):
    facts = {"origin": origin, "terrains": [1, 11], "positions": ["A"], "models": ["hapke"], "photo_domain": "real"}
    write_results_page(
        **run, **facts, site=site, others={"report.html": "Snakemake's report"}, page=folder / "results.html"
    )
    return (folder / "results.html").read_text()


def test_the_page_embeds_every_table_and_figure_of_the_run(tmp_path, run):
    page = written(tmp_path, run)
    assert set(re.findall(r"<strong>(\w+) &amp; more", page)) == set(run["tables"])
    assert re.findall(r'<figure id="(\w+)"', page) == [
        "comparison_Terrain01_PosA", "detection", "seen_real", "seen_hapke", "opposition",
    ]  # fmt: skip
    assert set(re.findall(r'src="(data:image/\w+)', page)) == {"data:image/webp"}
    assert len(re.findall(r'src="data:', page)) == 1 + 2 * len(run["figures"])  # strip, sections, list of all figures
    assert not re.search(r'src="(?!data:)', page)
    assert "the detector trained on Analog" in page  # images of the analog are never named real
    assert "0.5 | 0.4 &lt;x&gt;" in page
    assert "no number refers to NASA" in page
    assert "From 2 to 90 degrees." in page


def test_every_link_is_an_anchor_or_an_existing_file(tmp_path, run):
    page = written(tmp_path, run)
    links = set(re.findall(r'href="([^"]+)"', page)) - {"report.html"}  # written by another rule
    assert {"tables/ipd.csv", "tables/ipd.md", "figures/detection.png", "figures/strip/photo.png"} <= links
    ids = set(re.findall(r'id="([^"]+)"', page))
    assert all(link[1:] in ids if link.startswith("#") else (tmp_path / link).is_file() for link in links)


def test_screen_readers_find_the_main_landmark_and_every_link(tmp_path, run):
    """Rules of axe: all content is in one landmark, and a summary element contains no link."""
    page = written(tmp_path, run)
    (main,) = re.findall(r"<body><main>(.*)</main>", page, re.DOTALL)
    summaries = re.findall(r"<summary>(.*?)</summary>", main)
    assert len(summaries) == len(run["tables"])
    assert not any("<" in summary for summary in summaries)
    assert len(re.findall(r'<a href="tables/\w+\.csv">csv</a>', main)) == len(run["tables"])


def test_the_first_screen_describes_the_run_and_has_metrics_with_intervals(tmp_path, run):
    first = written(tmp_path, run).partition("<h2>")[0]
    for fact in ("demo", "analog", "01, 11 (positions A)", "1,234", "hapke", "1a2b3c4d", __version__):
        assert fact in first
    assert "<strong>0.46</strong>[0.41 to 0.54]" in first
    assert "trained on Analog" in first
    assert "A &lt;photo&gt;" in first


def test_the_page_of_another_site_names_the_site_instead_of_nasa(tmp_path, run):
    analog = ORIGIN | {"source": "analog"}
    assert "NASA" in written(tmp_path, run, origin=analog)
    text = written(tmp_path, run, "yard", analog)
    assert "NASA" not in text
    assert "<dt>site</dt><dd>yard</dd>" in text


def test_images_are_reduced_and_the_page_does_not_depend_on_modification_times(tmp_path, run):
    grain = np.random.default_rng(0).integers(0, 256, (600, 2400), "uint8")
    png.write_png(run["figures"]["detection"], grain)
    page = written(tmp_path, run)
    content = base64.b64decode(re.search(r'id="detection".*?base64,([^"]+)"', page)[1])
    assert Image.open(io.BytesIO(content)).size == (1100, 275)
    for path in [*run["tables"].values(), *run["figures"].values()]:
        os.utime(path, (10**9, 10**9))
    assert written(tmp_path, run) == page


def test_missing_parts_have_no_heading(tmp_path, run):
    page = written(tmp_path, run)
    assert "Stereo depth" not in page
    assert "Causes of the gap" not in page
    write_json(run["phases"][0], {"shown": False, "text": "No photo shows it"})
    assert "Opposition" not in written(tmp_path, run)


def test_images_are_counted_by_split_and_domain(run):
    assert picture_counts(run["datasets"], "files").to_numpy().tolist() == [["photo", "Real", 7, 1, 3]]


def test_a_missing_data_set_is_named_and_no_page_is_written(tmp_path, run):
    (run["datasets"]["photo", "real"] / "dataset.json").unlink()
    with pytest.raises(PolarsimError, match=r"dataset\.json"):
        written(tmp_path, run)
    assert not (tmp_path / "results.html").exists()


def test_a_cell_breaks_before_an_interval_but_not_inside():
    shown = _html("| a |\n|---|\n| 0.5 [0.4, 0.6] / 0.7 [0.6, 0.8] |\n")
    assert "0.5 [0.4,\N{NO-BREAK SPACE}0.6] / 0.7 [0.6,\N{NO-BREAK SPACE}0.8]" in shown
