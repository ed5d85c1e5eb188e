"""Table of stereo depth: depths from photos and twins compared with the meshes, and the IPD between domains."""

from __future__ import annotations

from pathlib import Path
from typing import cast

import pandas as pd

from polarsim.formats.tables import read_parquet
from polarsim.photo import PhotoKey, Terrain, terrain_text
from polarsim.report import paper
from polarsim.report.layout import interval_text, write_blocks
from polarsim.schemas.detect import BAD_DEPTH_MM, BAD_DEPTH_PERCENT, STEREO_IPD
from polarsim.schemas.report import STEREO

MEASURES = ("valid_share", "median_abs_error_mm", "bad_share", "bad_relative_share")
ALL = "all"
CAPTION = "Stereo depth (semi-global matching) compared with the depth of the meshes, means over image pairs."
IPD_CAPTION = "Instance performance difference of stereo depth between domains: value [95 % interval]."


def tabulate_stereo(*, stereo: Path, instances: Path, ipd: Path, stem: Path, origin: dict[str, str]) -> None:
    """Write tables/stereo.{csv,md,tex,parquet} from the tables of the detect stage."""
    pairs = read_parquet(stereo, ("domain", "terrain", *MEASURES))
    rocks = read_parquet(instances, ("domain", "key", "performance"))
    table = tidy_stereo(pairs, rocks, origin["source"])
    notes = [
        *paper.analog_notes(table, ["domain"]),
        "Over pixels visible in both cameras. bad_share: share without depth or with an error above "
        f"{BAD_DEPTH_MM:g} mm; bad_relative_share: above {BAD_DEPTH_PERCENT:g} %.",
        f"Performance of a rock: share of the rock's pixels with a depth error of at most {BAD_DEPTH_MM:g} mm.",
    ]
    differences = format_ipd(read_parquet(ipd, STEREO_IPD.columns), origin["source"])
    write_blocks(stem, table, {CAPTION: _shown(table), IPD_CAPTION: differences}, notes, origin)


def tidy_stereo(pairs: pd.DataFrame, rocks: pd.DataFrame, source: str) -> pd.DataFrame:
    """Return a row per domain and terrain, and one per domain for all terrains."""
    rocks = rocks.assign(terrain=[PhotoKey.parse(str(key)).terrain for key in rocks["key"]])
    rows = []
    for domain in paper.sorted_domains({str(name) for name in pairs["domain"]}):
        domain_pairs, domain_rocks = pairs[pairs["domain"] == domain], rocks[rocks["domain"] == domain]
        groups = [(ALL, domain_pairs, domain_rocks)]
        groups += [
            (terrain_text(cast(Terrain, terrain)), part, domain_rocks[domain_rocks["terrain"] == terrain])
            for terrain, part in domain_pairs.groupby("terrain")
        ]
        for name, part, part_rocks in groups:
            means = {measure: float(part[measure].mean()) for measure in MEASURES}
            row = {"domain": paper.display_name(domain, source), "terrain": name, "pairs": len(part)}
            rows.append(row | means | {"rocks": len(part_rocks), "performance": part_rocks["performance"].mean()})
    return pd.DataFrame(rows, columns=list(STEREO.columns))


def format_ipd(ipd: pd.DataFrame, source: str) -> pd.DataFrame:
    """Return a row per pair of domains: number of paired rocks, `ipd` and `ipd_abs` with intervals."""
    rows = []
    for entry in ipd.to_dict("records"):
        pair = paper.ordered_pair(*(paper.display_name(str(entry[name]), source) for name in ("first", "second")))
        row: dict[str, object] = {"domains": paper.pair_title(*pair), "rocks": int(entry["pairs"])}
        for name in ("ipd", "ipd_abs"):
            row[name] = interval_text(entry, name)
        rows.append(row)
    return pd.DataFrame(rows, columns=None if rows else ["domains"])


def _shown(table: pd.DataFrame) -> pd.DataFrame:
    return table.assign(domain=[paper.domain_title(str(domain)) for domain in table["domain"]])
