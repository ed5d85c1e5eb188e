"""What photos are like where judges do well and badly, and where the gap between photos and twins is largest."""

from __future__ import annotations

import pandas as pd

from polarsim.photo import ROCK
from polarsim.tables import paper
from polarsim.tables.section.estimates import Estimate, estimate, listed, verdict
from polarsim.tables.section.pages import Block, Heading, Paragraph, Table

GROUPINGS = {  # column `by` -> what it is by, and a group in words
    "size": ("size of the label", "{} labels"),
    "exposure": ("exposure", "{} ms"),
    "azimuth": ("azimuth of the Sun lamp", "azimuth {}"),
    "light": ("rover light", "light {}"),
    "terrain": ("terrain", "terrain {}"),
}
CONFOUNDED = "Photos without the Sun lamp are exposed for longer, so groups of exposure and of azimuth go together."


def parts_part(breakdown: pd.DataFrame, photos: str) -> list[Block]:
    """A paragraph and a table of each grouping, of the first split; the tables of the run have the others.

    Parameters
    ----------
    photos
        The domain that twins stand for: real or analog.
    """
    rocks = breakdown[(breakdown["kind"] == ROCK) & breakdown["map50"].notna()]
    split = rocks["split"].iloc[0] if len(rocks) else ""
    rocks = rocks[rocks["split"] == split]
    blocks: list[Block] = []
    for by, (words, group) in GROUPINGS.items():
        part = rocks[rocks["by"] == by]
        if part["group"].nunique() < 2:
            continue
        text = f"By {words} ([[by-{by}]]), each judge in its own domain: {extremes(part, group)}."
        if gaps := largest_gaps(part, photos, group):
            text += f" From its own domain to photos or twins a judge loses most so: {gaps}."
        blocks.append(Paragraph(text + (f" {CONFOUNDED}" if by == "exposure" else "")))
        blocks.append(
            Table(f"by-{by}", f"Rocks by {words}: mAP@0.5 with 95 % intervals, split by {split}.", group_rows(part))
        )
    return [Heading("Breakdown"), *blocks] if blocks else []


def extremes(part: pd.DataFrame, group: str) -> str:
    """Best and worst group of each judge in its own domain, of one grouping."""
    told = []
    for trained in paper.in_order(set(part["trained"])):
        found = _groups(part, trained, trained)
        if len(found) > 1:
            best, worst = (choose(found, key=lambda name: found[name].value) for choose in (max, min))
            told.append(
                f"{paper.title(trained)} {found[best].text()} at {group.format(best)} and {found[worst].text()} at "
                f"{group.format(worst)} ({verdict(found[best], found[worst])})"
            )
    return "; ".join(told) or "no judge has two groups"


def largest_gaps(part: pd.DataFrame, photos: str, group: str) -> str:
    """The group in which a judge of twins loses most on photos, and a judge of photos on twins; "" where none loses."""
    told = []
    domains = paper.in_order(set(part["evaluated"]))
    for trained in paper.in_order(set(part["trained"]) & set(domains)):
        others = [photos] if trained != photos else [name for name in domains if name != photos]
        for other in others:
            own, away = _groups(part, trained, trained), _groups(part, trained, other)
            lost = {name: own[name].value - away[name].value for name in own if name in away}
            if len(lost) < 2 or max(lost.values()) <= 0:
                continue
            worst = max(lost, key=lambda name: lost[name])
            told.append(
                f"{paper.title(trained)} on {paper.title(other)} at {group.format(worst)}, {own[worst].text()} to "
                f"{away[worst].text()} ({verdict(own[worst], away[worst])})"
            )
    return "; ".join(told)


def group_rows(part: pd.DataFrame) -> pd.DataFrame:
    """A row a judge and domain, a column a group, of one grouping."""
    groups = list(dict.fromkeys(part["group"]))
    rows = []
    for (trained, evaluated), found in part.groupby(["trained", "evaluated"], sort=False):
        row = {"trained on": paper.title(str(trained)), "evaluated on": paper.title(str(evaluated))}
        rows.append(row | {str(group): estimate(found[found["group"] == group], "map50").text() for group in groups})
    return pd.DataFrame(rows)


def _groups(part: pd.DataFrame, trained: str, evaluated: str) -> dict[str, Estimate]:
    own = part[(part["trained"] == trained) & (part["evaluated"] == evaluated)]
    return {str(group): estimate(rows, "map50") for group, rows in own.groupby("group", sort=False)}


def stereo_part(stereo: pd.DataFrame | None, ipd: pd.DataFrame | None, source: str) -> list[Block]:
    """Stereo depth as a second judge, where the run has it."""
    if stereo is None or not len(stereo):
        return []
    whole = stereo[stereo["terrain"] == "all"]
    told = listed(
        f"{100 * row['bad_share']:.1f} % on {paper.title(str(row['domain']))} ({int(row['pairs'])} pairs, "
        f"median error {row['median_abs_error_mm']:.1f} mm)"
        for _, row in whole.iterrows()
    )
    sentences = [
        f"Stereo matching, a judge that is not trained, leaves without a good depth {told} of the pixels ([[stereo]])."
    ]
    if ipd is not None:
        for row in ipd.to_dict("records"):
            pair = paper.ordered_pair(*(paper.own_name(str(row[name]), source) for name in ("first", "second")))
            value = Estimate(float(row["ipd"]), float(row["ipd_low"]), float(row["ipd_high"]))
            if value.known:
                sentences.append(f"IPD of its depth between {' and '.join(map(paper.title, pair))}: {value.text()}.")
    columns = ["domain", "pairs", "valid_share", "median_abs_error_mm", "bad_share", "rocks", "performance"]
    table = Table("stereo", "Stereo depth of each domain against the meshes.", whole[columns])
    return [Heading("Stereo depth"), Paragraph(" ".join(sentences)), table]
