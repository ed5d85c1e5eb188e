import dataclasses
import itertools
import math
import re

import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st

from polarsim.formats import png
from polarsim.formats.files import write_json
from polarsim.formats.tables import write_parquet
from polarsim.tables import (
    detection_table,
    false_alarms_table,
    ipd_rocks_table,
    results_section,
)
from polarsim.tables.section.detection import judges_of, matrix, own_and_others, papers_rows, split_sentences
from polarsim.tables.section.estimates import Estimate, compared, estimate, verdict
from polarsim.tables.section.gap import ipd_sentences
from polarsim.tables.section.ledger import ledger_part
from polarsim.tables.section.pages import Figure, Paragraph, Table, as_html, as_markdown
from polarsim.tables.section.parts import largest_gaps

ORIGIN = {"run": "demo", "source": "analog", "config": "1a2b3c4d"}
RULES = {
    "tone": "gamma", "min_mean_dn": 5.0, "confidence": 0.01, "iou_confidence": 0.25, "nms_iou": 0.6, "resamples": 1000,
    "model": "compact",
}  # fmt: skip
DOMAINS = ("analog", "principled", "hapke")
BOUNDS = {"low": -0.05, "high": 0.05}


def with_bounds(row, names):
    return row | {f"{name}_{bound}": row[name] + shift for name in names for bound, shift in BOUNDS.items()}


def detection(value_of, splits=("photo",), seeds=(0,), domains=DOMAINS):
    """Rows of rocks and shadows; `value_of(split, trained, evaluated)` is every measure."""
    rows = []
    for split, seed, kind, trained, evaluated in itertools.product(splits, seeds, ("rock", "shadow"), domains, domains):
        value = value_of(split, trained, evaluated) + 0.01 * seed
        row = {
            "trained": trained, "evaluated": evaluated, "kind": kind, "split": split, "seed": seed,
            "leaks_views": split == "photo", "judge": "compact (polarsim's own)", "start": "scratch", "epochs": 20,
            "imgsz": 288, "images": 144, "left_out": 0, "labels": 1413, "unit": "view", "units": 16,
        }  # fmt: skip
        measures = dict.fromkeys(detection_table.MEASURES, value)
        rows.append(with_bounds(row | measures, detection_table.MEASURES))
    return pd.DataFrame(rows)


def at_home(split, trained, evaluated):
    return 0.6 if trained == evaluated else 0.3


def ipd(values):
    """Rows of one judge's rocks: (first, second) -> ipd."""
    rows = [
        {"split": "photo", "seed": 0, "trained": "analog", "first": first, "second": second, "kind": "rock",
         "pairs": 90, "ipd": value, "ipd_abs": 2 * value, "ipd_low": value - 0.05, "ipd_high": value + 0.05,
         "ipd_abs_low": 2 * value - 0.05, "ipd_abs_high": 2 * value + 0.05, "paper_ipd": math.nan}
        for (first, second), value in values.items()
    ]  # fmt: skip
    return pd.DataFrame(rows)


@given(*[st.floats(0, 1)] * 4)
def test_figures_are_told_apart_only_where_their_intervals_do_not_meet(one, other, first_half, second_half):
    first = Estimate(one, one - first_half, one + first_half)
    second = Estimate(other, other - second_half, other + second_half)
    apart = compared(first, second)
    assert apart == -compared(second, first)
    if apart:
        assert (one > other) == (apart > 0)
        assert abs(one - other) > first_half + second_half - 1e-12
        assert verdict(first, second) == "distinguishable"
    else:
        assert verdict(first, second) == "not distinguishable"


def test_a_figure_without_interval_is_never_told_apart():
    assert compared(Estimate(0.9), Estimate(0.1, 0.0, 0.2)) == 0
    assert verdict(Estimate(0.9), Estimate(0.1, 0.0, 0.2)) == "no intervals"


def test_several_seeds_give_mean_deviation_and_the_span_of_all_intervals():
    rows = pd.DataFrame({"x": [0.4, 0.6], "x_low": [0.3, 0.5], "x_high": [0.5, 0.7]})
    found = estimate(rows, "x")
    assert found.text() == "0.500 ± 0.141 [0.300, 0.700]"
    assert estimate(rows[:1], "x").text() == "0.400 [0.300, 0.500]"
    assert estimate(rows[:0], "x").text() == "–"
    assert estimate(rows.assign(x_low=math.nan), "x").text() == "0.500 ± 0.141"


def test_the_diagonal_is_called_highest_only_where_it_is():
    assert own_and_others(matrix(rocks(at_home)))[0].startswith("Each of 3 judges scores highest in its own domain")

    def swapped(split, trained, evaluated):
        return 0.61 if (trained, evaluated) == ("hapke", "principled") else at_home(split, trained, evaluated)

    sentences = own_and_others(matrix(rocks(swapped)))
    assert sentences[0].startswith("2 of 3 judges score highest in their own domain")
    assert "0.610 [0.560, 0.660] on Principled (more, not distinguishable)" in sentences[3]
    assert "0.300 [0.250, 0.350] on Analog (less, distinguishable)" in sentences[3]


def rocks(value_of, **which):
    table = detection(value_of, **which)
    return table[table["kind"] == "rock"]


def test_judges_of_twins_are_ranked_on_photos_and_ties_are_said():
    def on_photos(split, trained, evaluated):
        return {"analog": 0.6, "principled": 0.3, "hapke": 0.25}[trained]

    first, second, third = judges_of(matrix(rocks(on_photos)), "analog")
    assert "that of Principled finds most rocks on it: mAP@0.5 0.300" in first
    assert "0.050 less (not distinguishable)" in second
    assert "0.50 times the figure of the judge trained on Analog (0.600 [0.550, 0.650]; distinguishable)" in third


def test_the_leak_of_views_is_told_from_two_splits_and_from_no_single_one():
    def leaky(split, trained, evaluated):
        return at_home(split, trained, evaluated) - (0.2 if split == "view" else 0)

    sentences = split_sentences(detection(leaky, splits=("photo", "view")))
    assert "Analog, own domain: mAP@0.5 0.600 [0.550, 0.650] split by photo, 0.400 [0.350, 0.450]" in sentences[1]
    assert "+0.200 with views on both sides (distinguishable)" in sentences[1]
    assert "has no strict split" in split_sentences(detection(leaky))[0]
    assert "has no legacy split" in split_sentences(detection(leaky, splits=("view",)))[0]


def test_the_smaller_gap_is_named_only_where_intervals_do_not_meet():
    far = ipd({("analog", "principled"): 0.1, ("analog", "hapke"): 0.3, ("principled", "hapke"): 0.2})
    assert "(distinguishable: the first gap is the smaller one)" in ipd_sentences(far, "analog")[0]
    assert "0.100 [0.050, 0.150] between Analog and Principled and 0.300" in ipd_sentences(far, "analog")[0]
    near = ipd({("analog", "principled"): 0.1, ("analog", "hapke"): 0.15})
    assert "smaller" not in ipd_sentences(near, "analog")[0]
    assert "Between 50 and 50 % of what single rocks differ by cancels" in ipd_sentences(near, "analog")[-1]


def test_the_largest_loss_is_found_by_group():
    rows = [
        {"trained": "hapke", "evaluated": evaluated, "group": group, "map50": value, "map50_low": value - 0.05,
         "map50_high": value + 0.05}
        for evaluated, values in (("hapke", (0.6, 0.5)), ("real", (0.5, 0.2)))
        for group, value in zip(("0064", "0256"), values, strict=True)
    ]  # fmt: skip
    told = largest_gaps(pd.DataFrame(rows), "real", "{} ms")
    assert told == "Hapke on Real at 0256 ms, 0.500 [0.450, 0.550] to 0.200 [0.150, 0.250] (distinguishable)"
    better = pd.DataFrame(rows).assign(evaluated=["real", "real", "hapke", "hapke"])
    assert largest_gaps(better, "real", "{} ms") == ""


def run_folder(tmp_path, table, source):
    """Files of a run with one rock that differs and some false alarms."""
    tables = tmp_path / "tables"
    ids = {"split": "photo", "seed": 0}
    write_parquet(tables / "detection.parquet", table)
    groups = [("size", "small"), ("size", "large"), ("exposure", "0064"), ("exposure", "0256")]
    sides = sorted(set(zip(table["trained"], table["evaluated"], strict=True)))
    rows = [
        with_bounds(ids | {"trained": t, "evaluated": e, "by": by, "group": group, "kind": "rock", "images": 9,
                           "units": 4, "labels": 50, "map50": 0.4 + 0.1 * (group == "large") - 0.1 * (t != e),
                           "map50_95": 0.2, "iou_mean": 0.3}, detection_table.MEASURES)
        for t, e in sides for by, group in groups
    ]  # fmt: skip
    write_parquet(tables / "detection_breakdown.parquet", pd.DataFrame(rows))
    photos = "analog" if source == "analog" else "real"
    values = {(photos, "principled"): 0.1, (photos, "hapke"): 0.3, ("principled", "hapke"): 0.2}
    write_parquet(tables / "ipd.parquet", ipd(values).assign(trained=photos, paper_ipd=0.2256))
    rocks = [
        ("hapke", photos, "hapke", 11, rock, "rock", 29, 0.5, 0.1 * rock, 0.5 - 0.1 * rock) for rock in (1, 2, 3, 4)
    ]
    write_parquet(
        tables / "ipd_rocks.parquet", pd.DataFrame(rocks, columns=list(ipd_rocks_table.COLUMNS)).assign(**ids)
    )
    alarm = ("hapke", photos, "rock-free terrain", "06", 45, 4, 45.0, 24, 0.5, 0.25, 0.75, 0.01, 0.005, 0.02)
    alarms = pd.DataFrame([alarm], columns=list(false_alarms_table.COLUMNS)).assign(**ids)
    write_parquet(tables / "false_alarms.parquet", alarms)
    counts = {"train": 259, "val": 29, "test": 144}
    states = {"used": 430, "missing": 0, "dark": 2, "corrupt": 1}
    datasets, pictures = {}, {}
    for domain in set(table["trained"]):
        datasets["photo", domain] = tmp_path / "datasets" / domain
        write_json(datasets["photo", domain] / "dataset.json", {"pictures": counts})
        pictures[domain] = tmp_path / "pictures" / domain
        write_json(pictures[domain] / "domain.json", {"pictures": states})
    return tables, datasets, pictures


def written(tmp_path, table, source="analog", figures=None, phases=None, ledger=None):
    tables, datasets, pictures = run_folder(tmp_path, table, source)
    results_section.write_results_section(
        tables=tables,
        stereo_ipd=None,
        datasets=datasets,
        pictures=pictures,
        figures=figures or {},
        phases=phases,
        ledger=ledger,
        page=tmp_path / "tables" / "results_section.html",
        rules=RULES,
        origin=ORIGIN | {"source": source},
    )
    return (tmp_path / "tables" / "results_section.html").read_text(), (
        tmp_path / "tables" / "results_section.md"
    ).read_text()


def test_the_page_tells_what_was_trained_on_what_and_what_was_left_out(tmp_path):
    page, text = written(tmp_path, detection(at_home))
    for told in (
        "compact (polarsim's own), started from random weights, trained for 20 epochs at 288 px with seed 0",
        "the same view lies on both sides",
        "mean below 5 DN above black are near-black and left out",
        "Left out as near-black: 2 of Analog",
        "Left out as corrupt (the picture or its labels): 1 of Analog",
        "| photo | Analog | 259 | 29 | 144 | 1413 | 1413 | 16 |",
        "rock 1 of terrain 11 with 0.50 on Analog and 0.10 on Hapke (29 pictures)",
        "the judge of Hapke asked about Analog has most false alarms, 0.500 [0.250, 0.750] a photo",
    ):
        assert told in text.replace("\\_", "_")
    assert "<h1>Results of run demo</h1>" in page
    assert "[[" not in page + text


def test_the_papers_figures_stand_on_the_page_of_nasas_photos_alone(tmp_path):
    _, text = written(tmp_path / "analog", detection(at_home))
    assert "0.987" not in text
    assert "0.2256" not in text
    _, text = written(tmp_path / "polar", detection(at_home, domains=("real", "principled", "hapke")), "polar")
    assert "| photo | Real | Real | 0.600 / 0.600 / 0.600 | 0.987 / 0.805 / 0.849 |" in text
    assert "a difference between both may be one of judge, training or split" in text


def test_every_table_and_figure_is_numbered_in_order_and_pictures_are_inside(tmp_path):
    png.write(tmp_path / "rocks.png", png_pixels())
    write_json(tmp_path / "phases.json", {"shown": True, "words": "At a phase angle of 2 degrees twins are bright"})
    figures = {"rocks-hapke": tmp_path / "rocks.png", "opposition": tmp_path / "rocks.png"}
    page, text = written(tmp_path, detection(at_home), figures=figures, phases=tmp_path / "phases.json")
    numbers = [int(number) for number in re.findall(r"\*\*Table (\d+)\.", text)]
    assert numbers == list(range(1, len(numbers) + 1))
    assert "Judge of Hapke: rock 1 of terrain 11" in text
    assert "(Figure 1)" in text
    assert "twins are bright (Figure 2)." in text
    assert page.count('src="data:image/png;base64,') == 2  # a JPEG would be larger
    assert "![Figure 1](../figures/rocks.png)" in text


def test_without_opposition_the_page_says_why_and_shows_no_figure(tmp_path):
    png.write(tmp_path / "o.png", png_pixels())
    write_json(
        tmp_path / "phases.json", {"shown": False, "words": "The smallest phase angle in this run is 30.0 degrees"}
    )
    _, text = written(
        tmp_path, detection(at_home), figures={"opposition": tmp_path / "o.png"}, phases=tmp_path / "phases.json"
    )
    assert "The smallest phase angle in this run is 30.0 degrees." in text
    assert "o.png" not in text


def test_the_gap_ledger_is_taken_as_it_stands(tmp_path):
    (tmp_path / "gap.md").write_text("**Gap \\_ledger.**\n\n| a | b |\n| --- | ---: |\n| x \\| y | 0.1 |\n\nA note.\n")
    blocks = ledger_part((tmp_path / "gap.md").read_text())
    table = next(block for block in blocks if isinstance(block, Table))
    assert table.caption == "Gap _ledger."
    assert table.table.to_dict("records") == [{"a": "x | y", "b": "0.1"}]
    assert "A note." in written(tmp_path, detection(at_home), ledger=tmp_path / "gap.md")[1]
    assert ledger_part(None) == []


def test_a_run_without_judges_has_a_page_that_says_so():
    rules = results_section.Rules("gamma", 0, 0.01, 0.25, 0.6, 1000)
    found = results_section.Found(*[detection(at_home)[:0]] * 5)
    blocks = results_section.section(found, results_section.Pictures({}, {}), rules, {}, "", ORIGIN)
    assert blocks[0] == Paragraph("No judge was trained in this run.")


def test_a_page_shows_text_as_text(tmp_path):
    png.write(tmp_path / "f.png", png_pixels())
    blocks = [
        Paragraph("a < b & [[one]]"),
        Table("one", "Of <i>.", pd.DataFrame({"<b>": ["<td>"]})),
        Figure("two", "See [[one]].", tmp_path / "f.png"),
    ]
    page = as_html("T", blocks)
    assert 'a &lt; b &amp; <a href="#one">Table 1</a>' in page
    assert "<td>&lt;td&gt;</td>" in page
    assert "Of &lt;i&gt;." in page
    assert "See Table 1." in as_markdown("T", blocks, "x")
    with pytest.raises(KeyError, match="three"):
        as_html("T", [Paragraph("[[three]]")])


def test_every_rule_of_the_page_is_an_option_of_the_detect_stage():
    from polarsim.detect.options import DetectOptions

    assert {field.name for field in dataclasses.fields(results_section.Rules)} <= set(DetectOptions.model_fields)


def test_several_seeds_and_splits_are_told_together(tmp_path):
    table = detection(at_home, splits=("photo", "view"), seeds=(0, 1))
    _, text = written(tmp_path, table)
    assert "with seeds 0 and 1" in text
    assert "0.605 ± 0.007 [0.550, 0.660]" in text
    assert "Split by view: Each of 3 judges" in text


def test_places_that_the_paper_does_not_know_are_not_compared():
    assert papers_rows(detection(at_home, domains=("views",))) is None


def png_pixels():
    import numpy as np

    return np.zeros((4, 4, 3), np.uint8)
