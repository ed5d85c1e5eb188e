"""Figure of the appearance of twins: photos, twins with the tone curve of the comparison, and differences."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from polarsim.formats import png
from polarsim.formats.tables import read_parquet
from polarsim.geometry.images import resize
from polarsim.photo import PhotoKey, terrain_text
from polarsim.report.figures.canvas import FIGURE_WIDTH, figure_title, note, page, show_image
from polarsim.report.figures.difference import TONES, TONES_MEANING, difference_bar, difference_of_tones
from polarsim.run_files.pictures import pictures_at
from polarsim.schemas.evaluation import APPEARANCE_PAIRS
from polarsim.scoring.appearance import (
    Appearance,
    ReducedPhoto,
    compare_reduced,
    reduce_photo,
    reduce_picture,
    sandbox_part,
    tone_of_twin,
)
from polarsim.scoring.twin_photos import ComparedPhoto, read_compared, read_in_size, subject_of, twin_of_same_view
from polarsim.tone import display_white_level, to_uint8

SHOWN = 4  # maximum number of photos
TITLE_PX = 72  # height of a title of two lines
BAR_PX = 150  # height of the title of the figure and of the colour bar


def draw_appearance(
    *,
    pairs: Sequence[Path],
    photos: Sequence[Path],
    twins: Sequence[Path],
    drawn: Path | None,
    figure: Path,
    width: int = FIGURE_WIDTH,
) -> None:
    """Write two rows per photo: photo and twins, below them the control and the differences of the twins in tone.

    The photos range from the largest to the smallest SSIM. Twins are shown with the tone curve of the comparison. The
    control is the twin of another terrain with the last model.

    Parameters
    ----------
    pairs : sequence of Path
        Tables `APPEARANCE_PAIRS` of the terrains.
    photos : sequence of Path
        Tables of photos, or the folder of published cover photos.
    twins : sequence of Path
        Folders of twins, `<model>/TerrainTT`.
    drawn : Path, optional
        Folder of masks of the lines in cover photos.
    """
    table = pd.concat([read_parquet(path, APPEARANCE_PAIRS.columns) for path in pairs], ignore_index=True)
    models = sorted(set(table["model"]))
    paths = {key: path for folder in photos for key, path in pictures_at(folder).items()}
    masks = pictures_at(drawn) if drawn else {}
    twins_of: dict[str, dict[PhotoKey, Path]] = {model: {} for model in models}
    for folder in twins:
        twins_of.get(folder.parent.name, {}).update(pictures_at(folder))
    shown = shown_photos(table)
    column = width // (1 + len(models))
    height = 2 * len(shown) * (round(column * aspect(paths.values())) + TITLE_PX) + BAR_PX
    with page(figure, width, height if shown else 300) as sheet:
        if not shown:
            note(sheet, "no photos for a comparison")
            return
        figure_title(sheet, "Photos and twins with PSNR / SSIM / correlation; below: twin minus photo, and the control")
        grid = sheet.subplots(2 * len(shown), 1 + len(models), squeeze=False)
        for number, name in enumerate(shown):
            key = PhotoKey.parse(name)
            rows = table[table["key"] == name].set_index("model")
            compared = ComparedPhoto(paths[key], masks.get(key))
            upper, lower = grid[2 * number : 2 * number + 2]
            _draw_photo(upper, lower, key, compared, twins_of, rows, column)
        difference_bar(sheet, list(grid.ravel()), TONES, TONES_MEANING)


def shown_photos(table: pd.DataFrame, n: int = SHOWN) -> list[str]:
    """Return keys of n photos from the largest to the smallest median SSIM over models, in equal steps of the rank."""
    medians = table.groupby("key")["ssim"].median().dropna().sort_index()
    ranked = list(medians.sort_values(ascending=False, kind="stable").index)
    steps = np.linspace(0, len(ranked) - 1, min(n, len(ranked))).round().astype(int)
    return [str(ranked[step]) for step in steps]


def _draw_photo(
    upper: Any,
    lower: Any,
    key: PhotoKey,
    compared: ComparedPhoto,
    twins: Mapping[str, Mapping[PhotoKey, Path]],
    rows: pd.DataFrame,
    column: int,
) -> None:
    """Draw a photo and its twins in a row of axes, and the control and the differences in the row below."""
    photo = ShownPhoto.read(compared, column)
    for axes in (*upper, *lower):
        axes.set_axis_off()
    show_image(upper[0], as_grey(photo.tones), f"Photo {key}")
    for axes, below, (model, row) in zip(upper[1:], lower[1:], rows.iterrows(), strict=False):
        twin, _ = photo.toned(twins[str(model)][key])
        show_image(axes, as_grey(twin), f"Twin, {subject_of(str(model), row['relation'])}\n{_scores(row)}")
        show_image(below, photo.difference(twin), "")
    model, row = str(rows.index[-1]), rows.iloc[-1]
    of_control = {other: path for other, path in twins[model].items() if other.terrain == row["control_terrain"]}
    control = twin_of_same_view(key, of_control)
    if control is None:
        lower[0].set_title("No control: no twin of another\nterrain under the same lamps")
    else:
        title = f"Control: terrain {terrain_text(control.terrain)}, {model}\n{_scores(row, 'control_')}"
        show_image(lower[0], as_grey(photo.toned(of_control[control])[0]), title)


@dataclass(frozen=True)
class ShownPhoto:
    """Compared part of a photo: at the size of the comparison, and at the size of a figure."""

    shape: tuple[int, ...]  # of the photo, px
    reduced: ReducedPhoto
    tones: np.ndarray  # (h, w) float32, grey values of the displayed photo
    clear: np.ndarray  # (h, w) bool, pixels without drawn lines

    @classmethod
    def read(cls, compared: ComparedPhoto, width: int) -> ShownPhoto:
        """Read a photo for a figure in which it is `width` px wide."""
        photo, drawn = read_compared(compared)
        used = photo if drawn is None or drawn.all() else photo[~drawn]
        tones = _small(to_uint8(photo, display_white_level(used)), width)
        clear = np.ones(tones.shape, bool) if drawn is None else _small(drawn, width) == 0
        return cls(photo.shape, reduce_photo(photo, drawn), tones, clear)

    def toned(self, path: Path) -> tuple[np.ndarray, Appearance]:
        """Return a twin (h, w) float32 with the tone curve of the comparison, and its similarity to the photo."""
        twin = read_in_size(path, self.shape)
        reduced = reduce_picture(twin)
        shown = tone_of_twin(self.reduced, reduced).apply(_small(twin, self.tones.shape[1]))
        return shown, compare_reduced(self.reduced, reduced)

    def difference(self, twin: np.ndarray) -> np.ndarray:
        """Return the coloured difference (h, w, 3) of a twin from `toned` and the photo."""
        return difference_of_tones(self.tones / 255, twin / 255, self.clear)


def _scores(row: pd.Series, prefix: str = "") -> str:
    return scores_text(*(row[f"{prefix}{name}"] for name in ("psnr_db", "ssim", "correlation")))


def scores_text(psnr_db: float, ssim: float, correlation: float) -> str:
    """Return PSNR, SSIM and correlation as text."""
    return f"{psnr_db:.1f} dB / {ssim:.3f} / {correlation:.3f}"


def _small(picture: np.ndarray, width: int) -> np.ndarray:
    """Return the compared part of an image (h, w), float32, scaled to a width."""
    part = sandbox_part(picture).astype(np.float32)
    return resize(part, (width, round(width * part.shape[0] / part.shape[1])))


def as_grey(tones: np.ndarray) -> np.ndarray:
    """Return an image (h, w, 3) uint8 of grey values (h, w)."""
    return np.repeat(np.clip(np.rint(tones), 0, 255).astype(np.uint8)[..., None], 3, axis=-1)


def aspect(photos: Iterable[Path]) -> float:
    """Return the height of the compared part of the first photo that exists over its width; 1 without a photo."""
    path = next((path for path in photos if path.exists()), None)
    if path is None:
        return 1.0
    header = png.parse_header(path.read_bytes())
    height, width = sandbox_part(np.empty((header.height, header.width), bool)).shape
    return height / width
