"""Tables of rock sizes and of the abundance of rocks, with the figure of their size-frequency distributions."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pandas as pd

from polarsim.formats.files import read_json
from polarsim.formats.tables import read_parquet, typed
from polarsim.geometry.size_frequency import fit_abundance, poisson_interval
from polarsim.photo import Terrain, terrain_text
from polarsim.report.figures.rock_sizes import draw_rock_sizes
from polarsim.report.layout import write_table
from polarsim.schemas import report
from polarsim.schemas.detect import ROCK_DIAMETERS
from polarsim.schemas.evaluation import TRUE_SIZES
from polarsim.schemas.stages import ROCK_SIZES

COMPLETE = 0.08  # metres: minimum diameter of rocks of which nearly all are detected, for numbers per area
AXES = ("a", "b", "c")
SIZES_CAPTION = (
    "Rock sizes: axes by calipers, orientation of the a axis, height, volume and plan diameter of the part above the "
    "ground; errors are the expected errors of scanned rocks, true values those of the true mesh cut at the ground."
)
ABUNDANCE_CAPTION = (
    f"Rocks with a diameter of at least {100 * COMPLETE:g} cm per area, the share of the ground that they cover, and k "
    "of the law of Golombek and Rapp (1997), F(D) = k exp(-(1.79 + 0.152 / k) D), with 95 % intervals (Poisson)."
)
DIAMETERS_CAPTION = (
    "Rocks from detections in photos alone: position and diameter by the camera model on level ground, merged over "
    "photos. Median errors of diameters on the analog are 16 %; false positives increase the abundance."
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
    write_table(table, rows, SIZES_CAPTION, layout=shown, notes=notes, origin=origin)
    area = {terrain: float(read_json(path)["area_m2"]) for terrain, path in sorted(areas.items())}
    diameters = {terrain: rows.loc[rows["terrain"] == terrain, "diameter_m"].to_numpy(float) for terrain in area}
    write_table(abundance, abundance_table(diameters, area), ABUNDANCE_CAPTION, origin=origin)
    draw_rock_sizes(figure, rows, diameters, area, COMPLETE)


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


def abundance_table(diameters: Mapping[Terrain, np.ndarray], areas: Mapping[Terrain, float]) -> pd.DataFrame:
    """Return a row per terrain, and a row of all terrains if there are several."""
    parts = {terrain_text(terrain): (diameters[terrain], area) for terrain, area in areas.items()}
    if len(parts) > 1:
        parts["all"] = (np.concatenate(list(diameters.values())), sum(areas.values()))
    rows = [{"terrain": name, **abundance_of(*part, COMPLETE)} for name, part in parts.items()]
    return typed(rows, report.ROCK_ABUNDANCE)


def abundance_of(diameters: np.ndarray, area: float, smallest: float) -> dict[str, float]:
    """Return number, number per m^2, covered share and k of rocks of at least `smallest` metres on `area` m^2."""
    counted = diameters[diameters >= smallest]
    low, high = poisson_interval(len(counted))
    fit = fit_abundance(counted, area, smallest)
    return {
        "rocks": len(counted), "area_m2": area,
        "per_m2": len(counted) / area, "per_m2_low": float(low) / area, "per_m2_high": float(high) / area,
        "covered": float(np.pi / 4 * (counted**2).sum() / area),
        "k": fit.k, "k_low": fit.low, "k_high": fit.high,
    }  # fmt: skip


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
