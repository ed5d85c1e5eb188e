"""What was trained on what, which pictures test, and by which rules: the first part of a results section."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import pandas as pd

from polarsim.photo import BOX_CLASSES, ROCK
from polarsim.tables import paper
from polarsim.tables.section.estimates import counted, listed, spanned
from polarsim.tables.section.pages import Block, Heading, Paragraph, Table
from polarsim.tables.seeds import SEED

SOURCES = {
    "analog": "a sandbox that this project simulates in NASA's formats: its pictures are no photos, and none of these "
    "figures is one of NASA's data",
    "polar": "NASA's photos",
    "release": "the published labels and scans, without photos",
}
SPLITS = {
    "photo": "photo by photo, as the paper's split most likely was",
    "view": "by view (terrain, position, camera)",
    "position": "by terrain and position",
    "terrain": "by whole terrains",
}
PARTS = ("train", "val", "test")


@dataclass(frozen=True)
class Rules:
    """Options of the detect stage that decide which pictures and predictions count."""

    tone: str
    min_mean_dn: float
    confidence: float  # least that is predicted
    iou_confidence: float  # least that counts for IOU_mean, IPD and false alarms
    nms_iou: float
    resamples: int


@dataclass(frozen=True)
class Pictures:
    """How many pictures each data set has.

    Attributes
    ----------
    parts
        (split, domain) -> part -> pictures.
    states
        domain -> state (used, missing, dark, corrupt) -> pictures, before they are shared out.
    """

    parts: Mapping[tuple[str, str], Mapping[str, int]]
    states: Mapping[str, Mapping[str, int]]


def methods(detection: pd.DataFrame, pictures: Pictures, rules: Rules, origin: Mapping[str, str]) -> list[Block]:
    """Data, judges, splits and rules.

    Parameters
    ----------
    detection
        Rows of `tables/detection`, domains by their names in our tables.
    """
    domains = paper.in_order(set(detection["evaluated"]))
    trained = paper.in_order(set(detection["trained"]))
    names = listed(map(paper.title, domains))
    source = SOURCES.get(origin["source"], origin["source"])
    blocks: list[Block] = [
        Heading("Data and judges"),
        Paragraph(
            f"Run {origin['run']} compares the domains {names}. Its source is {origin['source']}, {source}. "
            f"{counted(len(trained), 'judge')} a split and seed, each trained on one domain or mix "
            f"({listed(map(paper.title, trained))}), {'is' if len(trained) == 1 else 'are'} asked about the test "
            "pictures of every domain ([[data]])."
        ),
        Paragraph(" ".join([*_judges(detection), *_splits(detection)])),
        Paragraph(" ".join([_rules(rules, detection), *_left_out(pictures, rules)])),
    ]
    return [*blocks, Table("data", "Pictures and labels of every domain.", data_table(detection, pictures))]


def data_table(detection: pd.DataFrame, pictures: Pictures) -> pd.DataFrame:
    """A row a split and domain: training, validation and test pictures, test labels, views of the test."""
    rows = []
    for split, part in detection.groupby("split", sort=False):
        for domain in paper.in_order({*part["trained"], *part["evaluated"]}):
            tested = part[part["evaluated"] == domain]
            counts = pictures.parts.get((str(split), domain), {})
            row: dict[str, object] = {"split by": str(split), "domain": paper.title(domain)}
            row |= {f"{name} pictures": counts.get(name, "–") for name in PARTS}
            for kind in BOX_CLASSES:
                labels = tested.loc[tested["kind"] == kind, "labels"]
                row[f"test {kind}s"] = int(labels.iloc[0]) if len(labels) else "–"
            if "units" in tested.columns:
                row[f"{tested['unit'].iloc[0]}s" if len(tested) else "views"] = _first(tested, "units")
            rows.append(row)
    return pd.DataFrame(rows)


def _first(table: pd.DataFrame, name: str) -> object:
    return int(table[name].iloc[0]) if len(table) else "–"


def _judges(detection: pd.DataFrame) -> list[str]:
    sentences = []
    for (judge, start, epochs, imgsz), part in detection.groupby(["judge", "start", "epochs", "imgsz"], sort=False):
        seeds = sorted(set(part[SEED])) if SEED in part.columns else [0]
        start_words = "random weights" if start == "scratch" else str(start)
        begun = f", started from {start_words}," if start else ""
        sentences.append(
            f"The judge is {judge}{begun} trained for {counted(int(str(epochs)), 'epoch')} at {imgsz} px "
            f"with {'seed' if len(seeds) == 1 else 'seeds'} {listed(map(str, seeds))}."
        )
        if len(seeds) > 1:
            sentences.append(
                f"Figures are means ± standard deviations over the {len(seeds)} trainings; a bracket holds the 95 % "
                "intervals of all of them."
            )
    return sentences


def _splits(detection: pd.DataFrame) -> list[str]:
    sentences = []
    for split, part in detection.groupby("split", sort=False):
        leak = (
            "the same view lies on both sides, under other light, so these figures measure memory too"
            if part["leaks_views"].any()
            else "no view lies on both sides"
        )
        images = spanned([int(count) for count in part["images"]])
        sentences.append(f"The test part is drawn {SPLITS.get(str(split), split)}: {leak}; {images} test pictures.")
    return sentences


def _rules(rules: Rules, detection: pd.DataFrame) -> str:
    unit = str(detection["unit"].iloc[0]) if "unit" in detection.columns and len(detection) else "view"
    return (
        f"mAP counts predictions from a confidence of {rules.confidence:g} on, after non-maximum suppression at IoU "
        f"{rules.nms_iou:g}; IOU_mean, IPD and false alarms count those from {rules.iou_confidence:g} on. Brackets are "
        f"95 % intervals of a bootstrap over {unit}s ({counted(rules.resamples, 'resample')}). Two figures are called "
        "distinguishable only where their intervals do not meet."
    )


def _left_out(pictures: Pictures, rules: Rules) -> list[str]:
    """The rules of pictures that are not used, and how many each one hit."""
    black = (
        f"Pictures with a mean below {rules.min_mean_dn:g} DN above black are near-black and left out"
        if rules.min_mean_dn > 0
        else "Near-black pictures are kept (no least mean brightness is set)"
    )
    sentences = [f"Twelve bits become eight by the tone curve '{rules.tone}'. {black}."]
    for state, words in (
        ("dark", "near-black"), ("corrupt", "corrupt (the picture or its labels)"), ("missing", "missing")
    ):  # fmt: skip
        hit = {domain: counts[state] for domain, counts in pictures.states.items() if counts.get(state)}
        if hit:
            told = listed(f"{hit[domain]:,} of {paper.title(domain)}" for domain in paper.in_order(set(hit)))
            sentences.append(f"Left out as {words}: {told}.")
    if pictures.states and not any(
        counts.get(s) for counts in pictures.states.values() for s in ("corrupt", "missing")
    ):
        sentences.append("No picture or label is missing or corrupt.")
    return sentences


def rocks_of(table: pd.DataFrame) -> pd.DataFrame:
    """Rows that concern rocks, as the paper's figures do."""
    return table[table["kind"] == ROCK]
