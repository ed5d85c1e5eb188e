"""Comparison of the twins of a terrain with the photos: a row per photo and reflectance model.

1. Select photos, at most one per exposure bracket (`typical_photos`), or published cover photos with drawn lines.
2. Compare each photo with its twin (`appearance`) and match their features (`feature_agreement`).
3. Control: compare the photo with the twin of the same view and Sun of another terrain. The fitted tone curve shows
   likeness only if the photo's own twin is better.
4. State whether the photo took part in a fit (`relation_to_fits`).
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass
from math import log2
from pathlib import Path

import numpy as np
import pandas as pd

from polarsim.errors import FormatError
from polarsim.formats import png
from polarsim.formats.tables import key_columns, typed
from polarsim.photo import PhotoKey, Terrain, by_bracket
from polarsim.run_files.fitted_photos import FittedPhotos
from polarsim.run_files.instances import GROUND, instance_map_name
from polarsim.run_files.pictures import pictures_at
from polarsim.schemas.evaluation import APPEARANCE_PAIRS, HELD_OUT, IN_PLACE, NOT_FITTED
from polarsim.scoring.appearance import ReducedPhoto, compare_reduced, reduce_photo, reduce_picture, toned_twin
from polarsim.scoring.feature_agreement import compare_features, find_features

COMPARED_PHOTOS = 32  # maximum number per terrain, with at most a single photo per exposure bracket
NO_TERRAIN = -1  # terrain of the control without a twin of the same view and Sun; empty for named terrains
_CONTROLLED = ("psnr_db", "ssim", "correlation")  # metrics after the tone curve


@dataclass(frozen=True)
class ComparedPhoto:
    """Photo of 12 or 8 bits, mask with values above 0 at drawn lines, and instance map of the twins."""

    path: Path
    drawn: Path | None = None
    instances: Path | None = None


def compare_twins(
    photos: Mapping[PhotoKey, ComparedPhoto],
    twins: Mapping[str, Mapping[PhotoKey, Path]],
    others: Mapping[str, Mapping[PhotoKey, Path]],
    fits: Mapping[str, Sequence[FittedPhotos]],
) -> pd.DataFrame:
    """Return `APPEARANCE_PAIRS` of the photos of a terrain.

    Parameters
    ----------
    photos : mapping of PhotoKey to ComparedPhoto
        Photos to compare; photos without a twin are skipped.
    twins, others : mapping of model to images by photo key
        Twins of the terrain and of another terrain.
    fits : mapping of model to sequence of FittedPhotos
        Photos that took part in fits of the twins of a model; models without a fit may be missing.
    """
    rows = []
    for key, compared in sorted(photos.items()):
        paths = {model: by_key[key] for model, by_key in sorted(twins.items()) if key in by_key}
        if not paths:
            continue
        photo, drawn = read_compared(compared)
        lit_sand = None if compared.instances is None else read_in_size(compared.instances, photo.shape) == GROUND
        reduced = reduce_photo(photo, drawn, lit_sand)
        features = find_features(reduced.tones, reduced.valid)
        for model, path in paths.items():
            twin = reduce_picture(read_in_size(path, photo.shape))
            toned = toned_twin(reduced, twin)
            of_twin = find_features(toned, reduced.valid)
            rows.append(
                key_columns(key)
                | {"model": model, "relation": relation_to_fits(key, fits.get(model, ()))}
                | asdict(compare_reduced(reduced, twin, toned))
                | {"features": len(features.pixels)}
                | asdict(compare_features(features, of_twin))
                | _control(reduced, key, others.get(model, {}), photo.shape)
            )
    table = typed(rows, APPEARANCE_PAIRS)
    better = (table["psnr_db"] > table["control_psnr_db"]).astype("float64")
    return table.assign(better_than_control=better.where(table["control_psnr_db"].notna()))


def relation_to_fits(key: PhotoKey, fits: Iterable[FittedPhotos]) -> str:
    """Return whether a photo took part in one of the fits (`IN_PLACE`), in none (`HELD_OUT`), or nothing was fitted."""
    fits = list(fits)
    if not fits:
        return NOT_FITTED
    return IN_PLACE if any(fit.includes(key) for fit in fits) else HELD_OUT


def subject_of(model: str, relation: str) -> str:
    """Return the name of a model in tables; photos in place and held out are different subjects."""
    return model if relation == NOT_FITTED else f"{model}, {relation}"


def photos_to_compare(
    terrain: Terrain,
    photos: Path,
    covers: Path | None,
    drawn: Path | None,
    instances: Path,
    usual_exposure_ms: int,
) -> dict[PhotoKey, ComparedPhoto]:
    """Return typical photos of a terrain from a table of photos, or all cover photos from a folder of `KEY.png`.

    `drawn` is the folder of the masks of the lines in cover photos, `instances` that of the instance maps of the twins.
    """
    if covers is None:
        paths = {key: path for key, path in pictures_at(photos).items() if key.terrain == terrain}
        return {
            key: ComparedPhoto(paths[key], instances=instances / instance_map_name(key))
            for key in typical_photos(list(paths), COMPARED_PHOTOS, usual_exposure_ms)
        }
    masks = {} if drawn is None else pictures_at(drawn)
    found = {key: path for key, path in pictures_at(covers).items() if key.terrain == terrain}
    return {key: ComparedPhoto(path, masks.get(key)) for key, path in found.items()}


def typical_photos(keys: Sequence[PhotoKey], n: int, usual_exposure_ms: int) -> list[PhotoKey]:
    """Return up to n photos under a Sun lamp near the usual exposure, evenly distributed over exposure brackets."""
    brackets = by_bracket(key for key in keys if key.has_sun).values()
    typical = sorted(min(photos, key=lambda key: (key.stops_from(usual_exposure_ms), key)) for photos in brackets)
    if len(typical) <= n:
        return typical
    return [typical[number] for number in np.linspace(0, len(typical) - 1, n).round().astype(int)] if n else []


def twin_of_same_view(key: PhotoKey, others: Mapping[PhotoKey, Path]) -> PhotoKey | None:
    """Return the key of a twin of another terrain with the view and lamps of a photo and the nearest exposure."""
    similar = [other for other in others if other.bracket[1:] == key.bracket[1:] and other.terrain != key.terrain]
    return min(similar, key=lambda other: (abs(log2(other.exposure_ms / key.exposure_ms)), other), default=None)


def read_compared(compared: ComparedPhoto) -> tuple[np.ndarray, np.ndarray | None]:
    """Return a photo (h, w), and the mask (h, w) bool of lines drawn into a published photo."""
    photo = png.read_png(compared.path)
    return photo, None if compared.drawn is None else read_in_size(compared.drawn, photo.shape) > 0


def read_in_size(path: Path, shape: tuple[int, ...]) -> np.ndarray:
    """Return an image (h, w); raise FormatError if its size is not that of the photo."""
    picture = png.read_png(path)
    if picture.shape != shape:
        raise FormatError(f"{picture.shape[::-1]} pixels, expected {shape[::-1]} as in the photo", path=path)
    return picture


def _control(
    photo: ReducedPhoto, key: PhotoKey, others: Mapping[PhotoKey, Path], shape: tuple[int, ...]
) -> dict[str, object]:
    """Return the columns of the comparison with the twin of another terrain; empty without such a twin."""
    other = twin_of_same_view(key, others)
    if other is None:
        return {"control_terrain": NO_TERRAIN if isinstance(key.terrain, int) else ""}
    control = asdict(compare_reduced(photo, reduce_picture(read_in_size(others[other], shape))))
    return {"control_terrain": other.terrain} | {f"control_{name}": control[name] for name in _CONTROLLED}
