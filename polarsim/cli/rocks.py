"""Command that finds and measures rocks in a point cloud."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

import typer

from polarsim.arguments import writes_file
from polarsim.cli.application import commands_of
from polarsim.wording import counted

command = commands_of("Rocks")


@command("rocks")
def rocks_of_cloud(
    cloud: Annotated[Path, typer.Argument(help="Point cloud: PLY, LAS, LAZ (extra `las`), or text with x y z.")],
    out: Annotated[
        Path,
        typer.Option(
            callback=writes_file(".csv", ".parquet", ".json"), help="Table of rocks: .csv, .parquet or .json."
        ),
    ],
    unit: Annotated[Literal["m", "cm", "mm"], typer.Option(help="Unit of the coordinates in the file.")] = "m",
    up: Annotated[
        Literal["z", "-z", "y", "-y", "x", "-x"],
        typer.Option(help="Axis that points up, up to 45 degrees from the normal of the ground; -y in camera frames."),
    ] = "z",
    min_size_mm: Annotated[
        float,
        typer.Option(min=1, max=10_000, help="Minimum longest horizontal side of rocks, mm; sets all lengths."),
    ] = 35,
    complete_mm: Annotated[
        float | None,
        typer.Option(
            min=1,
            help="Minimum diameter in the fit of Golombek's law, mm, at least --min-size-mm; default: 80/35 of it.",
        ),
    ] = None,
    plot: Annotated[
        Path | None, typer.Option(callback=writes_file(".png"), help="PNG: map, cumulative number, covered share.")
    ] = None,
) -> None:
    """Find and measure rocks in a point cloud: axes a, b, c, orientation, height, volume, diameter.

    Sizes are those of the visible part above the ground. Objects with ground on one side only, such as walls, are
    excluded. Prints the abundance by the law of Golombek and Rapp (1997) with 95 % interval.
    """
    import numpy as np

    from polarsim.formats.tables import write_by_suffix
    from polarsim.geometry.size_frequency import fit_abundance
    from polarsim.report.figures.rock_sizes import draw_cloud_rocks
    from polarsim.rocks.options import RocksOptions
    from polarsim.rocks.single_cloud import find_rocks_in_cloud

    if complete_mm is not None and complete_mm < min_size_mm:
        raise typer.BadParameter(
            f"--complete-mm {complete_mm:g} is below --min-size-mm {min_size_mm:g}: smaller rocks are not searched for"
        )
    found = find_rocks_in_cloud(cloud, unit=unit, up=up, min_size_mm=min_size_mm)
    write_by_suffix(out, found.table)
    smallest = (complete_mm or min_size_mm * 80 / RocksOptions().min_size_mm) / 1000
    if plot:
        draw_cloud_rocks(
            plot, found.table, found.heights, found.rock_of_cell, found.axes, unit, found.area_m2, smallest
        )  # fmt: skip
    diameters = found.table["diameter_m"].to_numpy(float)
    fit = fit_abundance(diameters, found.area_m2, smallest)
    rocks, area = counted(len(found.table), "rock"), f"{found.area_m2:.4g} m2"
    typer.echo(
        f"{rocks} on {area} in {out}; {(diameters >= smallest).sum()} of at least {1000 * smallest:.3g} mm: "
        f"k = {fit.k:.3f} [{fit.low:.3f}, {fit.high:.3f}]"
    )
    if not len(found.table):
        typer.echo(
            f"examined: {area} for rocks from {min_size_mm:g} mm, with a point every {1000 * found.spacing:.3g} mm and "
            f"the ground {np.degrees(found.tilt):.0f} degrees from level with the axis {up} up; check --up, --unit and "
            "--min-size-mm"
        )
