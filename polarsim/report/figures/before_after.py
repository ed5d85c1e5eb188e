"""Figure of photos with a twin before and a twin after what was fitted to photos, and the remaining difference."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path

import numpy as np
import pandas as pd

from polarsim.formats.tables import read_parquet
from polarsim.photo import PhotoKey
from polarsim.report.figures.appearance import BAR_PX, TITLE_PX, ShownPhoto, as_grey, aspect, scores_text
from polarsim.report.figures.canvas import FIGURE_WIDTH, figure_title, note, page, show_image
from polarsim.report.figures.difference import TONES, TONES_MEANING, difference_bar
from polarsim.run_files.pictures import pictures_at
from polarsim.schemas.evaluation import APPEARANCE_PAIRS
from polarsim.scoring.twin_photos import ComparedPhoto, subject_of, typical_photos

SHOWN = 6  # maximum number of photos
_COLUMNS = 4


def draw_before_after(
    *,
    pairs: Sequence[Path],
    photos: Sequence[Path],
    drawn: Path | None,
    before: Sequence[Path],
    after: Sequence[Path],
    before_title: str,
    after_model: str,
    figure: Path,
    usual_exposure_ms: int,
    width: int = FIGURE_WIDTH,
) -> None:
    """Write a row per photo: photo, twin before, twin after, and the difference of the latter, all in tones.

    Each twin is shown with its best increasing tone curve, as in the comparison (PSNR / SSIM / correlation).

    Parameters
    ----------
    pairs : sequence of Path
        Tables `APPEARANCE_PAIRS` of the terrains, for the relation of photos to fits.
    photos : sequence of Path
        Tables of photos, or the folder of published cover photos.
    drawn : Path, optional
        Folder of masks of the lines in cover photos.
    before, after : sequence of Path
        Folders of twins, `<model>/TerrainTT`.
    """
    table = pd.concat([read_parquet(path, APPEARANCE_PAIRS.columns) for path in pairs], ignore_index=True)
    relations = table[table["model"] == after_model].set_index("key")["relation"]
    paths, twins, fitted = ({key: path for folder in of for key, path in pictures_at(folder).items()}
                            for of in (photos, before, after))  # fmt: skip
    masks = pictures_at(drawn) if drawn else {}
    compared = [key for key in paths if key in twins and key in fitted and str(key) in relations.index]
    keys = photos_of_terrains(compared, usual_exposure_ms)
    column = width // _COLUMNS
    height = len(keys) * (round(column * aspect(paths.values())) + TITLE_PX) + BAR_PX
    with page(figure, width, height if keys else 300) as sheet:
        if not keys:
            note(sheet, "no photos for a comparison")
            return
        figure_title(sheet, "Photos, and twins before and after fits, with PSNR / SSIM / correlation")
        grid = sheet.subplots(len(keys), _COLUMNS, squeeze=False)
        for row, key in zip(grid, keys, strict=True):
            photo = ShownPhoto.read(ComparedPhoto(paths[key], masks.get(key)), column)
            show_image(row[0], as_grey(photo.tones), f"Photo {key}")
            titles = before_title, subject_of(after_model, str(relations[str(key)]))
            for axes, title, path in zip(row[1:3], titles, (twins[key], fitted[key]), strict=True):
                shown, scores = photo.toned(path)
                text = scores_text(scores.psnr_db, scores.ssim, scores.correlation)
                show_image(axes, as_grey(shown), f"{title}\n{text}")
            show_image(row[3], photo.difference(shown), "Difference of the second twin")
        difference_bar(sheet, list(grid.ravel()), TONES, TONES_MEANING)


def photos_of_terrains(keys: Iterable[PhotoKey], usual_exposure_ms: int, n: int = SHOWN) -> list[PhotoKey]:
    """Return up to n photos under a Sun lamp with a usual exposure, evenly spaced, without rover light if possible."""
    found = sorted(keys)
    dark = [key for key in found if key.light == "off"]
    brackets = typical_photos(dark or found, len(found), usual_exposure_ms)
    chosen = np.linspace(0, len(brackets) - 1, min(n, len(brackets))).round().astype(int)
    return [brackets[number] for number in chosen]
