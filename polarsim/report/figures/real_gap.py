"""Figure of the difference of detection between photos and twins over the appearance of the twins."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pandas as pd

from polarsim.formats.tables import read_parquet
from polarsim.photo import ROCK
from polarsim.report import paper
from polarsim.report.figures.canvas import FAINT, FIGURE_WIDTH, SERIES, page
from polarsim.schemas.report import REAL_PHOTOS


def draw_real_gap(*, photos: Path, figure: Path, width: int = FIGURE_WIDTH) -> None:
    """Write a panel per detector: difference of the mean IoU of rocks (photo minus twin) over the SSIM of the twin.

    Dots are photos, averaged over seeds; large symbols are the mean over all rocks and the median SSIM of a domain.

    Parameters
    ----------
    photos : Path
        `tables/real_photos.parquet`.
    """
    table = read_parquet(photos, REAL_PHOTOS.columns)
    rocks = table[table["kind"] == ROCK]
    detectors = list(dict.fromkeys(rocks["trained"]))
    with page(figure, width, round(width * 0.42)) as sheet:
        panels = sheet.subplots(1, len(detectors), squeeze=False, sharex=True, sharey=True)[0]
        for axes, trained in zip(panels, detectors, strict=True):
            _draw_domains(axes, rocks[rocks["trained"] == trained])
            axes.set_title(f"detector trained on {paper.domain_title(trained)}")
            axes.set_xlabel("SSIM of photo and twin")
        panels[0].set_ylabel("IoU of rocks, photo minus twin")
        sheet.legend(*panels[0].get_legend_handles_labels(), ncols=4, loc="outside upper right")


def _draw_domains(axes: Any, rocks: pd.DataFrame) -> None:
    axes.axhline(0, color=FAINT, linewidth=0.8)
    for twin, colour in zip(dict.fromkeys(rocks["twin"]), SERIES, strict=False):
        part = rocks[rocks["twin"] == twin]
        photos = part.groupby("key").agg(difference=("difference", "mean"), ssim=("ssim", "first"))
        mean = (part["difference"] * part["pairs"]).sum() / part["pairs"].sum()
        axes.plot(photos["ssim"], photos["difference"], "o", color=colour, alpha=0.5, markersize=5)
        name = paper.domain_title(str(twin))
        axes.plot(photos["ssim"].median(), mean, "D", color=colour, markersize=13, label=name)
    axes.grid(visible=True)
