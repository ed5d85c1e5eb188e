"""Table of rock diameters from detections alone."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from polarsim.formats.files import read_json
from polarsim.formats.tables import read_parquet
from polarsim.photo import Terrain
from polarsim.report.layout import write_table
from polarsim.report.rock_abundance import COMPLETE, abundance_table
from polarsim.schemas.detect import ROCK_DIAMETERS

DIAMETERS_CAPTION = (
    "Rocks from detections in photos alone: position and diameter by the camera model on level ground, merged over "
    "photos. Median errors of diameters on the analog are 16 %; false positives increase the abundance."
)


def report_rock_diameters(
    *, diameters: Path, areas: Mapping[Terrain, Path], table: Path, origin: Mapping[str, str]
) -> None:
    """Write the table `rock_diameters`, with the abundance of each terrain with a rock in the notes.

    `table` is a path without suffix. Terrains without test photos have no rock and no abundance.
    """
    rows = read_parquet(diameters, ROCK_DIAMETERS.columns)
    seen = sorted(rows["terrain"].unique())
    area = {terrain: float(read_json(areas[terrain])["area_m2"]) for terrain in seen}
    by_terrain = {terrain: rows.loc[rows["terrain"] == terrain, "diameter_m"].to_numpy(float) for terrain in area}
    notes = [
        f"Terrain {row.terrain}: {row.rocks} rocks of at least {100 * COMPLETE:g} cm, k = {row.k:.3f} "
        f"[{row.k_low:.3f}, {row.k_high:.3f}]."
        for row in abundance_table(by_terrain, area).itertuples()
    ]
    write_table(table, rows, DIAMETERS_CAPTION, notes=notes, origin=origin)
