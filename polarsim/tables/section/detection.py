"""How well judges detect: in their own domain and in others, by legacy and by strict splits."""

from __future__ import annotations

from collections.abc import Mapping

import pandas as pd

from polarsim.photo import BOX_CLASSES, ROCK
from polarsim.tables import paper
from polarsim.tables.detection_table import MEASURES
from polarsim.tables.section.estimates import Estimate, counted, estimate, listed, verdict
from polarsim.tables.section.pages import Block, Heading, Paragraph, Table

TITLES = {"map50": "mAP@0.5", "map50_95": "mAP@[0.5:0.95]", "iou_mean": "IOU_mean"}
Matrix = Mapping[tuple[str, str], Estimate]  # (trained, evaluated)


def detection_part(detection: pd.DataFrame, photos: str, source: str) -> list[Block]:
    """Paragraphs and tables of detection.

    Parameters
    ----------
    photos
        The domain that twins stand for: real or analog.
    source
        Kind of the run's source: the paper's figures stand beside those of NASA's photos alone.
    """
    blocks: list[Block] = [Heading("Detection")]
    splits = list(dict.fromkeys(detection["split"]))
    for split in splits:
        rocks = matrix(detection[(detection["split"] == split) & (detection["kind"] == ROCK)])
        begin = f"Split by {split}: " if len(splits) > 1 else ""
        blocks.append(Paragraph(begin + " ".join(own_and_others(rocks))))
        blocks.append(Paragraph(begin + " ".join(judges_of(rocks, photos))))
        shadows = shadow_sentence(detection[detection["split"] == split])
        blocks += [Paragraph(begin + shadows)] if shadows else []
    blocks.append(Paragraph(" ".join(split_sentences(detection))))
    blocks.append(Table("detection", _caption(detection), detection_rows(detection)))
    theirs = papers_rows(detection) if paper.is_comparable(source) else None
    if theirs is not None:
        blocks.append(Paragraph(_beside_the_paper(detection) + " ([[paper]])."))
        caption = "Rocks, ours and the paper's (arXiv 2309.12397, Table 1): mAP@0.5 / mAP@[0.5:0.95] / IOU_mean."
        blocks.append(Table("paper", caption, theirs))
    return blocks


def matrix(rows: pd.DataFrame, measure: str = "map50") -> dict[tuple[str, str], Estimate]:
    """One figure of every judge and domain, over all seeds."""
    return {
        (str(trained), str(evaluated)): estimate(part, measure)
        for (trained, evaluated), part in rows.groupby(["trained", "evaluated"], sort=False)
    }


def own_and_others(rocks: Matrix) -> list[str]:
    """Each judge's own domain against all others, and in how many cases it is the best one."""
    judges = paper.in_order({trained for trained, _ in rocks if (trained, trained) in rocks})
    sentences, best = [], []
    for trained in judges:
        own = rocks[trained, trained]
        others = {evaluated: value for (judge, evaluated), value in rocks.items() if judge == trained != evaluated}
        others = {domain: others[domain] for domain in paper.in_order(set(others)) if others[domain].known}
        if not own.known or not others:
            continue
        best.append(all(own.value > value.value for value in others.values()))
        told = listed(
            f"{value.text()} on {paper.title(domain)} ({_relation(own, value)})" for domain, value in others.items()
        )
        sentences.append(
            f"The judge trained on {paper.title(trained)} reaches mAP@0.5 {own.text()} for rocks of its own domain, "
            f"{told}."
        )
    if not sentences:
        return ["No judge has figures in its own domain and in another one."]
    first = (
        f"Each of {counted(len(best), 'judge')} scores highest in its own domain ([[detection]])."
        if all(best)
        else f"{sum(best)} of {counted(len(best), 'judge')} score highest in their own domain ([[detection]])."
    )
    return [first, *sentences]


def judges_of(rocks: Matrix, photos: str) -> list[str]:
    """Which of the judges that have not seen photos finds most on them, and how far behind the photos' own judge."""
    asked = {trained: value for (trained, evaluated), value in rocks.items() if evaluated == photos and value.known}
    own = asked.pop(photos, None)
    title = paper.title(photos)
    if not asked:
        return [f"No judge but that of {title} is asked about it."]
    order = sorted(asked, key=lambda name: (-asked[name].value, paper.rank(name), name))
    best = asked[order[0]]
    sentences = [
        f"Of the judges that were not trained on {title} alone, that of {paper.title(order[0])} finds most rocks on "
        f"it: mAP@0.5 {best.text()}."
    ]
    sentences += [
        f"That of {paper.title(name)}: {asked[name].text()}, {best.value - asked[name].value:.3f} less "
        f"({verdict(best, asked[name])})."
        for name in order[1:]
    ]
    if own is not None and own.known and own.value > 0:
        sentences.append(
            f"The best of them reaches {best.value / own.value:.2f} times the figure of the judge trained on {title} "
            f"({own.text()}; {verdict(own, best)})."
        )
    return sentences


def shadow_sentence(detection: pd.DataFrame) -> str:
    """Shadows in each judge's own domain; no sentence where no shadow is labelled."""
    shadows = matrix(detection[detection["kind"] == BOX_CLASSES[1]])
    own = {name: shadows[name, name] for name in paper.in_order({t for t, e in shadows if t == e})}
    told = [f"{value.text()} on {paper.title(name)}" for name, value in own.items() if value.known]
    return (
        f"Shadows, which the paper does not evaluate, are found with mAP@0.5 {listed(told)}, each by its own judge."
        if told
        else ""
    )


def split_sentences(detection: pd.DataFrame) -> list[str]:
    """The legacy split against each strict one, in each judge's own domain."""
    splits = list(dict.fromkeys(detection["split"]))
    strict = [name for name in splits if not detection.loc[detection["split"] == name, "leaks_views"].any()]
    legacy = [name for name in splits if name not in strict]
    if not strict or not legacy:
        missing = "strict split (no view on both sides)" if legacy else "legacy split (views on both sides)"
        return [f"This run has no {missing}, so it cannot tell what memory of views adds to these figures."]
    sentences = []
    for name in strict:
        for trained in paper.in_order(set(detection["trained"])):
            remembered, honest = (
                matrix(detection[(detection["split"] == split) & (detection["kind"] == ROCK)]).get((trained, trained))
                for split in (legacy[0], name)
            )
            if remembered is None or honest is None or not (remembered.known and honest.known):
                continue
            sentences.append(
                f"{paper.title(trained)}, own domain: mAP@0.5 {remembered.text()} split by {legacy[0]}, "
                f"{honest.text()} split by {name}: {remembered.value - honest.value:+.3f} with views on both sides "
                f"({verdict(remembered, honest)})."
            )
    return ["What the leak of views is worth:", *sentences] if sentences else ["The splits have no figure in common."]


def detection_rows(detection: pd.DataFrame) -> pd.DataFrame:
    """A row a split, kind, judge and domain with the three measures."""
    several = len(set(detection["split"])) > 1
    rows = []
    for (split, kind, trained, evaluated), part in detection[detection["kind"].isin(BOX_CLASSES)].groupby(
        ["split", "kind", "trained", "evaluated"], sort=False
    ):
        names = {"labels": kind, "trained on": paper.title(str(trained)), "evaluated on": paper.title(str(evaluated))}
        row = ({"split by": split} if several else {}) | names
        rows.append(row | {TITLES[name]: estimate(part, name).text() for name in MEASURES})
    return pd.DataFrame(rows)


def papers_rows(detection: pd.DataFrame) -> pd.DataFrame | None:
    """Our figures beside the paper's, of the places that the paper has; None without any."""
    rows = []
    for (split, trained, evaluated), part in detection[detection["kind"] == ROCK].groupby(
        ["split", "trained", "evaluated"], sort=False
    ):
        theirs = paper.DETECTION.get((str(trained), str(evaluated)))
        if theirs:
            ours = " / ".join(f"{estimate(part, name).value:.3f}" for name in MEASURES)
            names = {"split by": split, "T": paper.title(str(trained)), "E": paper.title(str(evaluated))}
            rows.append(names | {"ours": ours, "paper": " / ".join(f"{value:.3f}" for value in theirs)})
    return pd.DataFrame(rows) if rows else None


def _beside_the_paper(detection: pd.DataFrame) -> str:
    judges = listed(f"{judge}, {epochs} epochs" for judge, epochs in _pairs(detection, "judge", "epochs"))
    return (
        "The paper's judge was a YOLOv5 fine-tuned for 200 epochs on 3,460 photos and tested on 1,730, split in a way "
        f"that it does not state; ours is {judges}: a difference between both may be one of judge, training or split"
    )


def _pairs(table: pd.DataFrame, *names: str) -> list[tuple[object, ...]]:
    return list(table[list(names)].drop_duplicates().itertuples(index=False, name=None))


def _caption(detection: pd.DataFrame) -> str:
    judges = listed(
        f"{judge}, {epochs} epochs at {imgsz} px"
        for judge, epochs, imgsz in _pairs(detection, "judge", "epochs", "imgsz")
    )
    seeds = listed(str(seed) for seed in sorted(set(detection["seed"])))
    splits = listed(dict.fromkeys(detection["split"]))
    trained = f"Judge {judges}; split by {splits}; seeds of training: {seeds}."
    return f"Detection with 95 % intervals, higher is better. {trained}"


def _relation(own: Estimate, other: Estimate) -> str:
    size = "less" if other.value < own.value else "more" if other.value > own.value else "the same"
    return f"{size}, {verdict(own, other)}"
