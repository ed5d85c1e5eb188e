"""All figures of one terrain's meshes and cameras."""

from __future__ import annotations

from pathlib import Path

from polarsim.report.figures.offsets import draw_offsets
from polarsim.report.figures.residuals import draw_residuals
from polarsim.report.figures.terrain import draw_terrain


def draw_geometry(
    *,
    terrain: int,
    rocks: Path,
    meshes: Path,
    cameras: Path,
    seeds: Path,
    photos: Path,
    inventory: Path,
    twins: Path | None,
    offsets: Path | None,
    meshes_figure: Path,
    crops_figure: Path,
    residuals_figure: Path,
    offsets_figure: Path | None,
) -> None:
    """Draw the meshes, the cuboids of the rocks, the residuals of the cameras and the distances from the true surface.

    `twins` replace missing photos; `offsets` are distances from the true surface, None without ground truth.
    """
    draw_terrain(terrain=terrain, rocks=rocks, meshes=meshes, meshes_figure=meshes_figure, crops_figure=crops_figure)
    draw_residuals(
        terrain=terrain,
        cameras=cameras,
        meshes=meshes,
        seeds=seeds,
        photos=photos,
        inventory=inventory,
        twins=twins,
        figure=residuals_figure,
    )
    if offsets and offsets_figure:
        draw_offsets(terrain=terrain, offsets=offsets, figure=offsets_figure)
