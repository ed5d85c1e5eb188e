"""Checks of the content of figures by their pixels."""

from functools import cache, lru_cache
from itertools import combinations
from pathlib import Path

import cv2
import numpy as np

from polarsim.formats import png
from polarsim.photo import PhotoKey
from polarsim.run_files.pictures import pictures_at
from polarsim.tone import to_8bit
from tests.report.pixels import coloured

REDUCED = 8  # reduction factor before the comparison
NARROWEST = 0.15  # minimum width of an image relative to the figure
WIDTH_STEP = 4  # px of the reduced figure; widths near the best of these are searched in steps of 1 px
BLOCK = 16  # px
ALIKE = 0.9  # minimum correlation of an image with its copy under labels; other photos reach 0.8
WHITE = 253  # minimum grey value of the background; the brightest matrix cell has 251
AZIMUTHS = ("30", "350", "270", "180", "no")  # preferred first, in the background of residuals
NOTE = 0.05  # maximum inked share of a figure that contains only a note
GREYS = 24  # minimum distinct greys in a block of an image; lines, text and uniform areas have fewer


def find_picture(figure: Path, picture: Path) -> tuple[float, np.ndarray]:
    """Return the highest correlation of an image of any size with a part of a figure, and the location.

    Returns
    -------
    correlation
        From -1 to 1; labels that are drawn on a picture take some hundredths.
    position
        (2,) float: x and y of the part's centre, as shares of the figure's width.
    """
    sheet, photo = reduced_sheet(figure), grey(to_8bit(png.read_png(picture)))
    photo = resized(photo, sheet.shape[1])

    @cache
    def match(width: int) -> tuple[float, np.ndarray]:
        part = resized(photo, width)
        if part.shape[0] > sheet.shape[0]:
            return -1.0, np.zeros(2)
        scores = np.nan_to_num(cv2.matchTemplate(sheet, part, cv2.TM_CCOEFF_NORMED))
        y, x = np.unravel_index(scores.argmax(), scores.shape)
        return float(scores.max()), (np.array([x, y]) + np.array(part.shape[::-1]) / 2) / sheet.shape[1]

    widths = range(round(NARROWEST * sheet.shape[1]), sheet.shape[1] + 1)
    nearest = widths.index(max(widths[::WIDTH_STEP], key=lambda width: match(width)[0]))
    near = widths[max(nearest - WIDTH_STEP + 1, 0) : nearest + WIDTH_STEP]
    return max(map(match, near), key=lambda found: found[0])


@lru_cache(maxsize=1)
def reduced_sheet(figure: Path) -> np.ndarray:
    """Return a figure in grey, reduced by `REDUCED`; all images of a figure are searched in turn."""
    sheet = grey(png.read_png(figure))
    return resized(sheet, sheet.shape[1] // REDUCED)


def pictured_share(figure: Path) -> float:
    """Return the share of blocks of a figure that show photos or renderings: many greys, none of them dominant."""
    pixels = np.round(grey(png.read_png(figure))).astype(int)
    rows, columns = (size // BLOCK for size in pixels.shape)
    blocks = pixels[: rows * BLOCK, : columns * BLOCK].reshape(rows, BLOCK, columns, BLOCK).swapaxes(1, 2)
    ordered = np.sort(blocks.reshape(rows * columns, -1), axis=1)
    many = (np.diff(ordered, axis=1) > 0).sum(axis=1) >= GREYS
    half = ordered.shape[1] // 2
    even = (ordered[:, half:] == ordered[:, :-half]).any(axis=1)  # half of the pixels have the same value
    return float((many & ~even).mean())


def grey(pixels: np.ndarray) -> np.ndarray:
    """Return (h, w) float32 from 0 to 255."""
    return (pixels if pixels.ndim == 2 else pixels[..., :3].mean(axis=-1)).astype(np.float32)


def resized(pixels: np.ndarray, width: int) -> np.ndarray:
    return cv2.resize(pixels, (width, round(width * pixels.shape[0] / pixels.shape[1])), interpolation=cv2.INTER_AREA)


def shown_pictures(results: Path, terrain: str, position: str) -> dict[str, list[Path]]:
    """Return the photos and twins in the figures of a position, by path of the figure."""
    photos = pictures_at(results / f"acquire/Terrain{terrain}/photos.parquet")
    keys = [key for key in photos if key.position == position]
    usual = min(keys, key=lambda key: (key.azimuth != "30", key.light, key.camera, key.stops_from(256)))
    brackets = {key.bracket: key for key in sorted(keys, key=lambda key: -key.stops_from(256))}  # the usual exposures
    twin = next((results / "renders").glob(f"*/Terrain{terrain}/{usual}.png"))
    seeds = (PhotoKey.parse(path.stem) for path in sorted((results / f"acquire/Terrain{terrain}/seeds").glob("*.txt")))
    of_position = [key for key in seeds if (key.camera, key.position) == ("L", position)]
    seed = min(of_position, key=lambda key: (AZIMUTHS.index(key.azimuth), key.light == "on", key))
    return {
        f"contact_Terrain{terrain}_Pos{position}.png": [photos[key] for key in brackets.values()],
        f"comparison_Terrain{terrain}_Pos{position}.png": [photos[usual], twin],
        f"residuals_Terrain{terrain}.png": [photos[seed]],
    }


def empty_figures(results: Path) -> dict[str, str]:
    """Return the figures of a run with missing content, each with a description.

    Contact sheets, comparisons and residuals must hold their photos and twins, at a place each unless the photos are
    alike; figures of pictures have areas of many greys; plots have data in colour. A figure that consists of a note is
    `note`.
    """
    found = {}
    for path in sorted((results / "figures").rglob("*.png")):
        name = str(path.relative_to(results / "figures"))
        least = [(measure, share) for start, measure, share in LEAST if name.startswith(start)]
        assert least, f"{name}: add this figure to LEAST"
        (measure, share), *_ = least
        value = measure(path)
        if value < share:
            is_note = inked_share(path) < NOTE and coloured(path) == 0
            found[name] = "note" if is_note else f"{measure.__name__} {value:.4f}, expected {share}"
    for photos in sorted((results / "acquire").glob("Terrain*/photos.parquet")):
        terrain = photos.parent.name.removeprefix("Terrain")
        for position in sorted({key.position for key in pictures_at(photos)}):
            for name, pictures in shown_pictures(results, terrain, position).items():
                places = [find_picture(results / "figures" / name, picture) for picture in pictures]
                at = [tuple(np.round(place / NARROWEST).astype(int)) for _, place in places]
                shared = [
                    (first.name, second.name)
                    for (first, one), (second, other) in combinations(zip(pictures, at, strict=True), 2)
                    if one == other and not are_alike(first, second)
                ]
                worst = min(correlation for correlation, _ in places)
                if worst < ALIKE or shared:
                    found[name] = f"correlation {worst:.2f}; at the same place: {shared}"
    return found


def are_alike(first: Path, second: Path) -> bool:
    """Return whether two photos may be found at the same place, such as photos with and without the rover light."""
    pixels = [resized(grey(to_8bit(png.read_png(path))), 240).ravel() for path in (first, second)]
    return bool(np.corrcoef(pixels)[0, 1] > ALIKE)


def inked_share(figure: Path) -> float:
    """Return the share of pixels that are not white."""
    return float((grey(png.read_png(figure)) < WHITE).mean())


LEAST = (  # start of the path, measure, and minimum value of a figure that is not blank
    ("appearance.", pictured_share, 0.1),
    ("comparison_", pictured_share, 0.1),
    ("contact_", inked_share, 0.5),  # few greys; the photos are searched
    ("crops_Terrain06", inked_share, 0.3),  # level sand without rocks has few greys
    ("crops_", pictured_share, 0.05),
    ("detection.", inked_share, 0.2),
    ("gap.", coloured, 0.0005),
    ("gap_rocks_", pictured_share, 0.1),
    ("ipd.", coloured, 0.0005),
    ("ipd_histogram.", coloured, 0.005),
    ("label_errors_", coloured, 0.01),
    ("meshes_Terrain06", inked_share, 0.3),
    ("meshes_", pictured_share, 0.1),
    ("offsets_", pictured_share, 0.1),
    ("opposition.", pictured_share, 0.1),
    ("precision_recall.", coloured, 0.001),
    ("reflectance.", coloured, 0.005),
    ("reliability.", coloured, 0.001),
    ("residuals_", pictured_share, 0.1),
    ("rock_sizes.", coloured, 0.001),
    ("rover_autonomy.", inked_share, 0.03),  # grey
    ("rover_drive.", coloured, 0.005),
    ("rover_front.", pictured_share, 0.1),
    ("rover_sequence.", pictured_share, 0.1),
    ("rover_", coloured, 0.0005),  # figures of autonomous drives
    ("seen_", pictured_share, 0.1),
    ("strip/", pictured_share, 0.1),
)
