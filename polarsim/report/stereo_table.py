"""The table of stereo depth: how near depths from photos and from twins are to the meshes, and the IPD between them."""

from __future__ import annotations

from pathlib import Path

import pandas as pd

from polarsim.formats.tables import read_parquet
from polarsim.report import paper
from polarsim.report.layout import origin_note, with_origin, write_blocks
from polarsim.report.seeds import with_interval
from polarsim.schemas.detect import BAD_DEPTH_MM, BAD_DEPTH_PERCENT, STEREO_IPD
from polarsim.schemas.report import STEREO

MEASURES = ("valid_share", "median_abs_error_mm", "bad_share", "bad_relative_share")
ALL = "all"
CAPTION = "Stereo depth (semi-global matching) against the depth of the meshes, means over pairs of pictures."
IPD_CAPTION = "Instance performance difference of stereo depth between domains. Each cell: value [95 %]."


def tabulate_stereo(*, stereo: Path, instances: Path, ipd: Path, stem: Path, origin: dict[str, str]) -> None:
    """Write tables/stereo.{csv,md,tex,parquet} from the files of the detect stage; the limits go into the notes."""
    pairs = read_parquet(stereo, ("domain", "terrain", *MEASURES))
    rocks = read_parquet(instances, ("domain", "key", "performance"))
    table = tidy_stereo(pairs, rocks, origin["source"])
    notes = [
        *paper.analog_notes(table, ["domain"]),
        "Over pixels that both cameras see. bad_share: without a depth, or off by more than "
        f"{BAD_DEPTH_MM:g} mm; bad_relative_share: by more than {BAD_DEPTH_PERCENT:g} %.",
        f"A rock's performance is the share of its pixels with a depth within {BAD_DEPTH_MM:g} mm.",
        origin_note(origin),
    ]
    differences = format_ipd(read_parquet(ipd, STEREO_IPD.columns), origin["source"])
    write_blocks(stem, with_origin(table, origin), {CAPTION: _shown(table), IPD_CAPTION: differences}, notes)


def tidy_stereo(pairs: pd.DataFrame, rocks: pd.DataFrame, source: str) -> pd.DataFrame:
    """A row for every domain and terrain, and one for all of a domain's terrains."""
    rocks = rocks.assign(terrain=rocks["key"].str[:2].astype("int64"))
    rows = []
    for domain in paper.in_order({str(name) for name in pairs["domain"]}):
        own, own_rocks = pairs[pairs["domain"] == domain], rocks[rocks["domain"] == domain]
        groups = [(ALL, own, own_rocks)]
        groups += [
            (f"{terrain:02d}", part, own_rocks[own_rocks["terrain"] == terrain])
            for terrain, part in own.groupby("terrain")
        ]
        for name, part, seen in groups:
            figures = {measure: float(part[measure].mean()) for measure in MEASURES}
            row = {"domain": paper.own_name(domain, source), "terrain": name, "pairs": len(part)}
            rows.append(row | figures | {"rocks": len(seen), "performance": seen["performance"].mean()})
    return pd.DataFrame(rows, columns=list(STEREO.columns))


def format_ipd(ipd: pd.DataFrame, source: str) -> pd.DataFrame:
    """A row a pair of domains: rocks that are paired, both forms of IPD with their intervals."""
    rows = []
    for entry in ipd.to_dict("records"):
        pair = paper.ordered_pair(*(paper.own_name(str(entry[name]), source) for name in ("first", "second")))
        row: dict[str, object] = {"domains": " - ".join(map(paper.title, pair)), "rocks": int(entry["pairs"])}
        for name in ("ipd", "ipd_abs"):
            row[name] = with_interval(pd.Series(entry), name)
        rows.append(row)
    return pd.DataFrame(rows, columns=None if rows else ["domains"])


def _shown(table: pd.DataFrame) -> pd.DataFrame:
    return table.assign(domain=[paper.title(str(domain)) for domain in table["domain"]])
