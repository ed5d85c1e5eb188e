"""Tables of rock sizes and of the abundance of rocks, with the figure of their size-frequency distributions."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import pandas as pd

from polarsim.formats.files import read_json
from polarsim.formats.tables import read_parquet, typed
from polarsim.photo import Terrain
from polarsim.report.figures.rock_sizes import draw_rock_sizes
from polarsim.report.layout import write_table
from polarsim.report.rock_abundance import COMPLETE, abundance_table
from polarsim.schemas import report
from polarsim.schemas.evaluation import TRUE_SIZES
from polarsim.schemas.stages import ROCK_SIZES

AXES = ("a", "b", "c")
SIZES_CAPTION = (
    "Rock sizes: axes by calipers, orientation of the a axis, height, volume and plan diameter of the part above the "
    "ground; errors are the expected errors of scanned rocks, true values those of the true mesh cut at the ground."
)
ABUNDANCE_CAPTION = (
    f"Rocks with a diameter of at least {100 * COMPLETE:g} cm per area, the share of the ground that they cover, and k "
    "of the law of Golombek and Rapp (1997), F(D) = k exp(-(1.79 + 0.152 / k) D), with 95 % intervals (Poisson)."
)


def report_rock_sizes(
    *,
    sizes: Mapping[Terrain, Path],
    areas: Mapping[Terrain, Path],
    true_sizes: Mapping[Terrain, Path],
    table: Path,
    abundance: Path,
    figure: Path,
    origin: Mapping[str, str],
) -> None:
    """Write the tables `rock_sizes` and `rock_abundance` and the figure, from files by terrain.

    `true_sizes` is empty without ground truth. `table` and `abundance` are paths without suffix.
    """
    parts = [_of_terrain(terrain, path, true_sizes.get(terrain)) for terrain, path in sorted(sizes.items())]
    rows = typed(pd.concat(parts, ignore_index=True), report.ROCK_SIZES)
    notes = [_error_note(rows, name, rows["true_a_m"] >= COMPLETE) for name in ("true", "whole") if true_sizes]
    shown = rows.dropna(axis="columns", how="all")
    # Volumes are in litres, because a rock of 10 cm has 0.0005 m3.
    volumes = [name for name in map(str, shown.columns) if name.endswith("_m3")]
    shown = shown.assign(**{name: 1000 * shown[name] for name in volumes})
    shown = shown.rename(columns={name: name.replace("_m3", "_litres") for name in volumes})
    write_table(table, rows, SIZES_CAPTION, layout=shown, notes=notes, origin=origin)
    area = {terrain: float(read_json(path)["area_m2"]) for terrain, path in sorted(areas.items())}
    diameters = {terrain: rows.loc[rows["terrain"] == terrain, "diameter_m"].to_numpy(float) for terrain in area}
    write_table(abundance, abundance_table(diameters, area), ABUNDANCE_CAPTION, origin=origin)
    draw_rock_sizes(figure, rows, diameters, area, COMPLETE)


def _of_terrain(terrain: Terrain, sizes: Path, true_sizes: Path | None) -> pd.DataFrame:
    """Return the sizes of a terrain with the true sizes, which are empty for unmatched rocks."""
    table = read_parquet(sizes, ROCK_SIZES.columns)
    true = typed([], TRUE_SIZES)
    if true_sizes is not None:
        true = read_parquet(true_sizes, TRUE_SIZES.columns)
    return table.merge(true, on="rock", how="left").assign(terrain=terrain)


def _error_note(rows: pd.DataFrame, kind: str, counted: pd.Series) -> str:
    """Return the median absolute relative errors of the counted rocks against the `true` or `whole` axes."""
    part = rows[counted]
    errors = [100 * (part[f"{axis}_m"] / part[f"{kind}_{axis}_m"] - 1).abs().median() for axis in AXES]
    against = {"true": "the true mesh cut at the ground", "whole": "the entire true rock, buried part included"}[kind]
    texts = ", ".join(f"{axis} {error:.1f} %" for axis, error in zip(AXES, errors, strict=True))
    return f"Median errors against {against}, true a axis of at least {100 * COMPLETE:g} cm, n = {len(part)}: {texts}."
