"""How far projected meshes lie from the boxes that people drew, as arrows in the photos."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from polarsim.formats import png
from polarsim.formats.yolo import read_rock_boxes
from polarsim.geometry.boxes import assign, centres, iou
from polarsim.geometry.consensus import consensus_boxes
from polarsim.geometry.meshes import Mesh
from polarsim.geometry.outlines import Outlines, outlines_of
from polarsim.photo import HEIGHT, HEX_COLOURS, NO_ROCK, ROCK, WIDTH, PhotoKey
from polarsim.report.figures.canvas import FIGURE_WIDTH, SERIES, legend_line, note, page, picture
from polarsim.report.figures.cover_photos import SAME, near_red, share_on_red
from polarsim.run_files.pictures import cover_photo, pictures_at
from polarsim.run_files.rigs import LocalisedRig, read_all_localised
from polarsim.run_files.scene import TerrainMesh, read_terrain
from polarsim.scoring.surface import Surface
from polarsim.tone import to_8bit

LENGTHENED = 20  # times that arrows are longer than what they show
DRAWN, PROJECTED, ARROW = HEX_COLOURS[ROCK], SERIES[5], SERIES[1]
_LEGEND_PX = 50
GREY = np.full((HEIGHT, WIDTH, 3), 90, np.uint8)  # where there is no picture


def draw_residuals(
    *,
    terrain: int,
    cameras: Path,
    meshes: Path,
    seeds: Path,
    photos: Path,
    inventory: Path,
    twins: Path | None = None,
    figure: Path,
    width: int = FIGURE_WIDTH,
) -> None:
    """Write a panel a position: agreed seed boxes, boxes of the projected meshes, and arrows from those to these.

    Parameters
    ----------
    photos, inventory : Path
        Table and inventory of the terrain's photos. A position is drawn on a left photo with seeds, else on its cover
        photo if the seeds lie on the red boxes there (some are of the right camera), else on a twin.
    twins : Path or None
        Folder of the terrain's twins.
    """
    localised, drawn = read_all_localised(cameras), read_rock_boxes(seeds, terrain)
    backgrounds = _backgrounds(seeds, drawn, photos, inventory, twins)
    outlines = outlines_of(_above_ground(read_terrain(meshes, terrain)))
    columns = min(2, max(1, len(localised)))
    rows = -(-len(localised) // columns)
    with page(figure, width, round(width / columns * rows * 0.77) + _LEGEND_PX) as sheet:
        if not localised:
            note(sheet, "no position")
            return
        panels = sheet.subplots(rows, columns, squeeze=False).ravel()
        for axes in panels[len(localised) :]:
            axes.set_axis_off()
        for axes, (position, rig) in zip(panels, sorted(localised.items()), strict=False):
            boxes = consensus_boxes(drawn.get(position, []))
            _draw_position(axes, f"Terrain {terrain:02d}, {position}", rig, outlines, boxes, backgrounds.get(position))
        looks = ({"color": DRAWN}, {"color": PROJECTED, "linestyle": "--"}, {"color": ARROW})
        lines = [legend_line(linewidth=2.5, **look) for look in looks]
        labels = (
            "boxes that people agree on", "boxes of projected meshes",
            f"from those to these, drawn {LENGTHENED} times as long",
        )  # fmt: skip
        sheet.legend(lines, labels, loc="outside lower center", ncols=3)


def _backgrounds(
    seeds: Path, drawn: Mapping[str, Sequence[np.ndarray]], photos: Path, inventory: Path, twins: Path | None
) -> dict[str, Path | None]:
    """By position, the left photo of its first seed that has one, else its left cover, else a twin of usual light."""
    pictures, rendered = pictures_at(photos), pictures_at(twins) if twins else {}
    found: dict[str, Path | None] = {}
    for key in (PhotoKey.parse(path.stem) for path in sorted(seeds.glob("*.txt"))):
        if key.camera == "L" and found.get(key.position) is None:
            found[key.position] = pictures.get(key)
    for position, boxes in drawn.items():
        found[position] = found.get(position) or _left_cover(cover_photo(inventory, position), boxes)
    for key in sorted(rendered, key=lambda key: (key.azimuth == "no", key.light == "on", key.stops_off_usual, key)):
        if key.camera == "L" and found.get(key.position) is None:
            found[key.position] = rendered[key]
    return found


def _left_cover(cover: Path | None, drawn: Sequence[np.ndarray]) -> Path | None:
    """A cover photo on whose red boxes some left photo's boxes lie: beside those of a right one all looks misplaced."""
    if cover is None or not cover.exists():
        return None
    red = near_red(to_8bit(png.read(cover)))
    return cover if max((share_on_red(red, boxes) for boxes in drawn), default=0.0) > SAME else None


def _above_ground(scene: TerrainMesh) -> dict[int, Mesh]:
    """Rocks with what lies in the sand raised to its surface: people draw what they see."""
    level = scene.part(NO_ROCK)
    ground = Surface(level.vertices, level.faces)
    raised = {}
    for rock in scene.rocks:
        mesh = scene.part(rock)
        lift = np.nan_to_num(np.maximum(-ground.height_below(mesh.vertices), 0))  # NaN beside the ground
        raised[rock] = Mesh(mesh.vertices + lift[:, None] * [0.0, 0.0, 1.0], mesh.faces)
    return raised


def _draw_position(
    axes: Any, name: str, rig: LocalisedRig, outlines: Outlines, boxes: np.ndarray, photo: Path | None
) -> None:
    pixels = to_8bit(png.read(photo)) if photo is not None and photo.exists() else GREY
    projected = outlines.seen(rig.camera("L"))
    rows, columns = assign(projected, boxes)
    ours, theirs = projected[rows], boxes[columns]
    start, end = centres(theirs), centres(ours)
    scale = pixels.shape[1] / WIDTH
    if len(rows):
        off = np.median(np.abs(end - start), axis=0)
        overlap = np.diag(iou(ours, theirs)).mean()
        name += f": {len(rows)} of {len(boxes)} boxes\nmean IoU {overlap:.2f}, median {off[0]:.1f}, {off[1]:.1f} px"
    elif len(boxes):
        name += f": none of {len(boxes)} boxes\npaired with a mesh"
        theirs, ours = boxes, projected[np.isfinite(projected).all(axis=1)]
    else:
        name += ": no box to compare,\nnobody drew a rock here"
        ours = projected[np.isfinite(projected).all(axis=1)]
    picture(axes, pixels, name)
    for some, colour, dashes in ((theirs, DRAWN, "-"), (ours, PROJECTED, "--")):
        for x0, y0, x1, y1 in some * scale:
            axes.plot([x0, x1, x1, x0, x0], [y0, y0, y1, y1, y0], color=colour, linewidth=1.3, linestyle=dashes)
    if len(rows):
        axes.quiver(
            *(start * scale).T, *(LENGTHENED * scale * (end - start)).T, color=ARROW, angles="xy",
            scale_units="xy", scale=1, width=0.004,
        )  # fmt: skip
    height, width = pixels.shape[:2]
    axes.set(xlim=(-0.5, width - 0.5), ylim=(height - 0.5, -0.5))  # arrows and boxes may reach out of the photo
