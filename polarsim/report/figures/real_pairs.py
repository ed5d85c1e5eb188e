"""Figure of cover photos next to their twins, with the labels of each domain."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from polarsim.formats import png
from polarsim.formats.tables import LABEL_COLUMNS, read_parquet
from polarsim.photo import COLOURS, ROCK
from polarsim.report import paper
from polarsim.report.figures.canvas import FIGURE_WIDTH, aspect_of, boxed, page, show_image

_TITLE_PX = 40
_CORNERS = ["x0", "y0", "x1", "y1"]


def draw_real_pairs(
    *, pictures: Mapping[str, Path], labels: Mapping[str, Path], figure: Path, width: int = FIGURE_WIDTH
) -> None:
    """Write a row per photo and a column per domain, with the boxes of rocks that detectors are trained and tested on.

    Titles have the domain, and above the photo its key: keys above all columns would overlap.

    Parameters
    ----------
    pictures, labels : mapping of str to Path
        Folder of `KEY.png` and label table of each domain, see `pair_covers_with_twins`. Photos are in the first.
    """
    tables = {domain: read_parquet(path, LABEL_COLUMNS) for domain, path in labels.items()}
    paths = sorted(next(iter(pictures.values())).glob("*.png"))
    names = [path.name for path in paths]
    column = width // len(pictures)
    with page(figure, width, len(names) * (round(column * aspect_of(paths)) + _TITLE_PX)) as sheet:
        for row, name in zip(sheet.subplots(len(names), len(pictures), squeeze=False), names, strict=True):
            for axes, (domain, folder) in zip(row, pictures.items(), strict=True):
                table = tables[domain]
                rocks = table[(table["key"] == Path(name).stem) & (table["kind"] == ROCK)]
                coloured = [(box, COLOURS[ROCK]) for box in rocks[_CORNERS].to_numpy(float)]
                title = paper.domain_title(domain) + (f", {Path(name).stem}" if axes is row[0] else "")
                show_image(axes, boxed(png.read_png(folder / name), coloured, column), title)
