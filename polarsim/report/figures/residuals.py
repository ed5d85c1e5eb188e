"""Figure of the residuals between seed boxes and the bounding boxes of projected meshes, as arrows in the photos."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from polarsim.formats import png
from polarsim.formats.yolo import read_rock_boxes
from polarsim.geometry.boxes import box_centres, iou, match_by_position_and_size, match_gate_px
from polarsim.geometry.consensus import consensus_boxes
from polarsim.geometry.meshes import Mesh
from polarsim.geometry.outlines import Outlines, outlines_of
from polarsim.photo import HEX_COLOURS, NO_ROCK, NO_SUN, ROCK, PhotoKey, Terrain, terrain_text
from polarsim.report.figures.canvas import FIGURE_WIDTH, PREDICTED, SERIES, legend_line, note, page, show_image
from polarsim.report.figures.cover_photos import MIN_SHARE, near_red, share_on_red
from polarsim.run_files.pictures import cover_photo, pictures_at
from polarsim.run_files.rigs import LocalisedRig, read_all_localised
from polarsim.run_files.scene import TerrainMesh, read_terrain
from polarsim.scoring.surface import Surface
from polarsim.site import Site
from polarsim.tone import to_8bit

ARROW_SCALE = 20  # magnification of the arrows
ANNOTATED, PROJECTED, ARROW = HEX_COLOURS[ROCK], SERIES[5], PREDICTED
_TITLE_PX, _LEGEND_PX = 105, 60
_SHORT_NAME = 24  # maximum letters of a terrain and position in one line with the number of boxes
_GREY = 90  # of a missing image


def draw_residuals(
    *,
    site: Site,
    terrain: Terrain,
    cameras: Path,
    meshes: Path,
    seeds: Path,
    photos: Path,
    inventory: Path,
    twins: Path | None = None,
    figure: Path,
    width: int = FIGURE_WIDTH,
) -> None:
    """Write a panel per position: consensus of the seed boxes, boxes of projected meshes, arrows between them.

    The background of a panel is a left photo with seeds; without such a photo, a cover photo whose red boxes match the
    seeds (some cover photos are of the right camera), or a twin.
    """
    localised, annotated = read_all_localised(cameras), read_rock_boxes(seeds, terrain, site.images.size)
    backgrounds = _backgrounds(site, seeds, annotated, photos, inventory, twins)
    outlines = outlines_of(_above_ground(read_terrain(meshes, terrain, site.sandbox_of(terrain))))
    columns = min(3, max(1, len(localised)))
    rows = -(-len(localised) // columns)
    height = round(width / columns * rows * site.images.height / site.images.width) + rows * _TITLE_PX + _LEGEND_PX
    with page(figure, width, height) as sheet:
        if not localised:
            note(sheet, "no position")
            return
        panels = sheet.subplots(rows, columns, squeeze=False).ravel()
        for axes in panels[len(localised) :]:
            axes.set_axis_off()
        for axes, (position, rig) in zip(panels, sorted(localised.items()), strict=False):
            boxes = consensus_boxes(annotated.get(position, []))
            title = f"Terrain {terrain_text(terrain)}, position {position}"
            _draw_position(axes, title, rig, outlines, boxes, backgrounds.get(position))
        styles = {
            "consensus of seed boxes": {"color": ANNOTATED},
            "without a mesh": {"color": ANNOTATED, "linestyle": ":"},
            "boxes of projected meshes": {"color": PROJECTED, "linestyle": "--"},
            f"offset of the centre, {ARROW_SCALE} times magnified": {"color": ARROW},
        }
        lines = [legend_line(linewidth=2.5, **style) for style in styles.values()]
        sheet.legend(lines, list(styles), loc="outside lower center", ncols=len(styles))


def _backgrounds(
    site: Site,
    seeds: Path,
    annotated: Mapping[str, Sequence[np.ndarray]],
    photos: Path,
    inventory: Path,
    twins: Path | None,
) -> dict[str, Path | None]:
    """Return the background of each position: a left photo with seeds, a left cover photo, or a twin of usual light."""
    pictures, rendered = pictures_at(photos), pictures_at(twins) if twins else {}
    background: dict[str, Path | None] = {}
    annotated_keys = [PhotoKey.parse(path.stem) for path in sorted(seeds.glob("*.txt"))]
    # Of lamps around the sandbox, the first and the last are next to each other. Sand is clipped against a lamp.
    order = (*site.suns[:1], *reversed(site.suns[1:]), NO_SUN)
    for key in sorted(annotated_keys, key=lambda key: (order.index(key.azimuth), key.light == "on", key)):
        if key.camera == "L" and background.get(key.position) is None:
            background[key.position] = pictures.get(key)
    for position, boxes in annotated.items():
        background[position] = background.get(position) or _left_cover(
            cover_photo(inventory, position), boxes, site.images.size
        )
    usual = site.usual_exposure_ms
    for key in sorted(rendered, key=lambda key: (not key.has_sun, key.light == "on", key.stops_from(usual), key)):
        if key.camera == "L" and background.get(key.position) is None:
            background[key.position] = rendered[key]
    return background


def _left_cover(cover: Path | None, annotated: Sequence[np.ndarray], size: tuple[int, int]) -> Path | None:
    """Return the cover photo if the red boxes match the seed boxes of a left photo, otherwise None."""
    if cover is None or not cover.exists():
        return None
    red = near_red(to_8bit(png.read_png(cover)))
    return cover if max((share_on_red(red, boxes, size) for boxes in annotated), default=0.0) > MIN_SHARE else None


def _above_ground(scene: TerrainMesh) -> dict[int, Mesh]:
    """Return the rock meshes with vertices below the ground raised to its surface, since seed boxes enclose the
    visible part of a rock.
    """
    ground_mesh = scene.part(NO_ROCK)
    ground = Surface(ground_mesh.vertices, ground_mesh.faces)
    raised = {}
    for rock in scene.rocks:
        mesh = scene.part(rock)
        lift = np.nan_to_num(np.maximum(-ground.height_below(mesh.vertices), 0))  # NaN outside the ground mesh
        raised[rock] = Mesh(mesh.vertices + lift[:, None] * [0.0, 0.0, 1.0], mesh.faces)
    return raised


def _draw_position(
    axes: Any, name: str, rig: LocalisedRig, outlines: Outlines, boxes: np.ndarray, photo: Path | None
) -> None:
    lens = rig.rig.left
    pixels = np.full((*lens.shape, 3), _GREY, np.uint8)
    if photo is not None and photo.exists():
        pixels = to_8bit(png.read_png(photo))
    projected = outlines.seen(rig.camera("L"))
    rows, columns = match_by_position_and_size(projected, boxes, match_gate_px(lens.width))
    matched, matched_boxes = projected[rows], boxes[columns]
    start, end = box_centres(matched_boxes), box_centres(matched)
    scale = pixels.shape[1] / lens.width
    if len(rows):
        off = np.median(np.abs(end - start), axis=0)
        overlap = np.diag(iou(matched, matched_boxes)).mean()
        matches, quality = f"{len(rows)} of {len(boxes)} boxes matched", f"mean IoU {overlap:.2f}"
        short = f"{name}: {matches}\n{quality}"
        name = short if len(name) <= _SHORT_NAME else f"{name}\n{matches}, {quality}"
        name += f"\nmedian offset {off[0]:.1f} px across, {off[1]:.1f} px down"
    elif len(boxes):
        name += f": none of {len(boxes)} boxes\nmatched with a mesh"
        matched_boxes, matched = boxes, projected[np.isfinite(projected).all(axis=1)]
    else:
        name += ":\nno annotated rock for a comparison"
        matched = projected[np.isfinite(projected).all(axis=1)]
    show_image(axes, pixels, name)
    unmatched = np.delete(boxes, columns, axis=0) if len(rows) else boxes[:0]
    drawn = ((matched_boxes, ANNOTATED, "-"), (unmatched, ANNOTATED, ":"), (matched, PROJECTED, "--"))
    for shown, colour, dashes in drawn:
        for x0, y0, x1, y1 in shown * scale:
            axes.plot([x0, x1, x1, x0, x0], [y0, y0, y1, y1, y0], color=colour, linewidth=1.3, linestyle=dashes)
    if len(rows):
        axes.quiver(
            *(start * scale).T, *(ARROW_SCALE * scale * (end - start)).T, color=ARROW, angles="xy",
            scale_units="xy", scale=1, width=0.004,
        )  # fmt: skip
    height, width = pixels.shape[:2]
    axes.set(xlim=(-0.5, width - 0.5), ylim=(height - 0.5, -0.5))  # crop arrows and boxes outside the photo
