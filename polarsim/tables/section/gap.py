"""How differently the same rocks are found in two domains, and what judges see where no rock is."""

from __future__ import annotations

import pandas as pd

from polarsim.photo import ROCK
from polarsim.tables import paper
from polarsim.tables.false_alarms_table import lay_out_false_alarms
from polarsim.tables.ipd_rocks_table import largest
from polarsim.tables.section.estimates import Estimate, compared, counted, estimate, listed, verdict
from polarsim.tables.section.pages import Block, Heading, Paragraph, Table

Pair = tuple[str, str]
SHOWN_ROCKS = 3  # of each judge, in words


def ipd_part(ipd: pd.DataFrame, photos: str, source: str) -> list[Block]:
    """Paragraphs and the table of instance performance differences of rocks; nothing without pairs."""
    rows = ipd[(ipd["kind"] == ROCK) & ipd["ipd"].notna()]
    if not len(rows):
        return [Heading("Instance performance difference"), Paragraph("No rock is labelled in two domains.")]
    blocks: list[Block] = [Heading("Instance performance difference")]
    splits = list(dict.fromkeys(rows["split"]))
    blocks.append(
        Paragraph(
            "IPD is the absolute value of the mean difference of the rocks' IoU, as the paper's table computes it; "
            "ipd_abs, the mean of the absolute differences, lets no gain cancel a loss ([[ipd]]). Lower is better."
        )
    )
    for split in splits:
        begin = f"Split by {split}: " if len(splits) > 1 else ""
        blocks.append(Paragraph(begin + " ".join(ipd_sentences(rows[rows["split"] == split], photos))))
    seeds = listed(str(seed) for seed in sorted(set(rows["seed"])))
    caption = (
        f"IPD of rocks with 95 % intervals, lower is better. Split by {listed(splits)}; seeds of training: {seeds}."
    )
    return [*blocks, Table("ipd", caption, ipd_rows(rows, paper.is_comparable(source)))]


def ipd_sentences(rows: pd.DataFrame, photos: str) -> list[str]:
    """Of every judge: which twin is nearer to photos, and whether the figures can tell; where nothing can be told."""
    sentences = []
    for trained in paper.in_order(set(rows["trained"])):
        own = rows[rows["trained"] == trained]
        found: dict[Pair, Estimate] = {
            (str(first), str(second)): estimate(part, "ipd")
            for (first, second), part in own.groupby(["first", "second"], sort=False)
        }
        sim_to_real = sorted((pair for pair in found if photos in pair), key=lambda pair: (found[pair].value, pair))
        if sim_to_real:
            told = listed(f"{found[pair].text()} between {_title(pair)}" for pair in sim_to_real)
            sentences.append(
                f"As the judge trained on {paper.title(trained)} sees it, IPD is {told}{_nearer(found, sim_to_real)}."
            )
        for pair, value in found.items():
            if photos not in pair:
                folded = " (its interval reaches 0)" if value.low == 0 else ""
                sentences.append(f"Between {_title(pair)} it is {value.text()}{folded}.")
    return [*sentences, *_cancelling(rows)]


def _nearer(found: dict[Pair, Estimate], pairs: list[Pair]) -> str:
    if len(pairs) < 2:
        return ""
    first, second = found[pairs[0]], found[pairs[1]]
    if compared(first, second):
        return " (distinguishable: the first gap is the smaller one)"
    return f" ({verdict(first, second)})"


def _cancelling(rows: pd.DataFrame) -> list[str]:
    """How much of the differences cancels in the paper's formula."""
    means = rows.groupby(["trained", "first", "second"])[["ipd", "ipd_abs"]].mean()
    share = (1 - means["ipd"] / means["ipd_abs"]).dropna()
    if not len(share):
        return []
    low, high = 100 * share.min(), 100 * share.max()
    return [f"Between {low:.0f} and {high:.0f} % of what single rocks differ by cancels in IPD: compare ipd_abs."]


def ipd_rows(rows: pd.DataFrame, with_paper: bool) -> pd.DataFrame:
    """A row a split, judge and pair of domains; the paper's figure where the run's pictures may stand beside it."""
    several = len(set(rows["split"])) > 1
    shown = []
    for (split, trained, first, second), part in rows.groupby(["split", "trained", "first", "second"], sort=False):
        row: dict[str, object] = {"split by": split} if several else {}
        row |= {"trained on": paper.title(str(trained)), "domains": _title((str(first), str(second)))}
        row |= {"rocks": int(part["pairs"].iloc[0])}
        row |= {name: estimate(part, name).text(4) for name in ("ipd", "ipd_abs")}
        if with_paper:
            row["paper's ipd"] = float(part["paper_ipd"].iloc[0])
        shown.append(row)
    return pd.DataFrame(shown)


def rocks_part(rocks: pd.DataFrame, photos: str, pictured: set[str]) -> list[Block]:
    """In words the rocks that differ most between photos and twins.

    Parameters
    ----------
    rocks
        Rows of `tables/ipd_rocks`; of several seeds the mean counts.
    pictured
        Judges of which a figure with key `rocks-<judge>` follows.
    """
    own = rocks[(rocks["kind"] == ROCK) & ((rocks["first"] == photos) | (rocks["second"] == photos))]
    if not len(own):
        return []
    first_split = own["split"].iloc[0]
    own = own[own["split"] == first_split]
    names = ["trained", "first", "second", "terrain", "rock", "kind"]
    figures = ["photos", "iou_first", "iou_second", "difference"]
    means = own.groupby(names, sort=False)[figures].mean().reset_index()
    sentences = []
    for trained in paper.in_order(set(means["trained"])):
        found = largest(means[means["trained"] == trained], 3 * SHOWN_ROCKS).drop_duplicates(["terrain", "rock"])
        told = listed(_rock_words(row) for _, row in found.iloc[:SHOWN_ROCKS].iterrows())
        place = f" ([[rocks-{trained}]])" if trained in pictured else ""
        sentences.append(f"Judge of {paper.title(trained)}: {told}{place}.")
    between = f"between {paper.title(photos)} and twins (split by {first_split}, mean IoU over pictures)"
    lead = f"Rocks that differ most {between}:"
    return [Heading("Rocks of the largest gap"), Paragraph(" ".join([lead, *sentences]))]


def _rock_words(row: pd.Series) -> str:
    first, second = paper.title(str(row["first"])), paper.title(str(row["second"]))
    return (
        f"rock {int(row['rock'])} of terrain {int(row['terrain'])} with {row['iou_first']:.2f} on {first} and "
        f"{row['iou_second']:.2f} on {second} ({counted(round(row['photos']), 'picture')})"
    )


def false_alarms_part(alarms: pd.DataFrame) -> list[Block]:
    """Where judges see most and fewest rocks that are none."""
    if not len(alarms):
        return []
    sentences = []
    for split in dict.fromkeys(alarms["split"]):
        for place, part in alarms[alarms["split"] == split].groupby("place", sort=False):
            found = {
                (str(trained), str(evaluated)): estimate(rows, "per_photo")
                for (trained, evaluated), rows in part.groupby(["trained", "evaluated"], sort=False)
            }
            known = {sides: value for sides, value in found.items() if value.known}
            if known:
                sentences.append(_alarm_sentence(str(split), str(place), part, known))
    table = Table("alarms", "False alarms a photo and their share of its area, with 95 % intervals, lower is better.",
                  lay_out_false_alarms(alarms))  # fmt: skip
    return [Heading("False alarms"), Paragraph(" ".join([*sentences, "[[alarms]] has all."])), table]


def _alarm_sentence(split: str, place: str, rows: pd.DataFrame, found: dict[Pair, Estimate]) -> str:
    terrains = str(rows["terrains"].iloc[0]).split()
    worst = max(found, key=lambda sides: found[sides].value)
    none = sum(value.value == 0 for value in found.values())
    where = f"{place} (split by {split}, terrain{'s' if len(terrains) > 1 else ''} {listed(terrains)})"
    if found[worst].value == 0:
        return f"On {where} no judge sees a rock where none is."
    without = f"; {none} of {len(found)} pairs of judge and domain have none" if none else ""
    own = [value.value for (trained, evaluated), value in found.items() if trained == evaluated]
    others = [value.value for (trained, evaluated), value in found.items() if trained != evaluated]
    at_home = (
        f", {max(own):.3f} at most in a judge's own domain and {max(others):.3f} in another one"
        if own and others
        else ""
    )
    return (
        f"On {where} the judge of {paper.title(worst[0])} asked about {paper.title(worst[1])} has most false alarms, "
        f"{found[worst].text()} a photo{at_home}{without}."
    )


def _title(pair: Pair) -> str:
    return " and ".join(map(paper.title, pair))
