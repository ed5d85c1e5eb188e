"""Photos and twins by photo key, from tables and folders that are inputs of a rule (`run_files.run`: of a run)."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from pathlib import Path

from polarsim.errors import FormatError
from polarsim.formats.files import resolve_from
from polarsim.formats.readers import reader
from polarsim.formats.tables import read_parquet
from polarsim.photo import PhotoKey
from polarsim.run_files.inventory import read_inventory

STRIP_TEXT = "strip.json"  # in the folder of a strip: photo key, and name and caption of each panel


@reader("pictures")
def pictures_at(folder: Path) -> dict[PhotoKey, Path]:
    """Return images by photo key, from a table of photos (see `resolve_from`) or a folder of twins."""
    if not isinstance(folder, Path):  # iteration over a string instead of a list of paths yields characters
        raise TypeError(f"{folder!r} is a {type(folder).__name__}, expected a pathlib.Path")
    if folder.suffix != ".parquet":
        if not folder.is_dir():
            raise FormatError("no such folder of images", path=folder)
        return {PhotoKey.parse(path.stem): path for path in sorted(folder.glob("[!.]*.png"))}  # not those being written
    photos = read_parquet(folder, ["key", "path"])
    stated = {
        PhotoKey.parse(str(key)): Path(str(path)) for key, path in zip(photos["key"], photos["path"], strict=True)
    }
    if not stated:
        return stated
    first = next(iter(stated.values()))
    root = Path(str(resolve_from(first, folder)).removesuffix(str(first)))  # all photos are below the same root
    return {key: root / path for key, path in stated.items()}


def picture_finder(photo_domain: str, folders: Iterable[Path]) -> Callable[[str, PhotoKey], Path | None]:
    """Return a function that returns the image of a domain and photo key, or None.

    Parameters
    ----------
    photo_domain
        Domain of the photos.
    folders
        Tables of photos, and folders of twins `<domain>/TerrainTT`.
    """
    of_domain: dict[str, dict[PhotoKey, Path]] = {}
    for folder in folders:
        pictures = pictures_at(folder)
        domain = photo_domain if folder.suffix == ".parquet" else folder.parent.name
        of_domain.setdefault(domain, {}).update(pictures)
    return lambda domain, key: of_domain.get(domain, {}).get(key)


@reader("inventory")
def cover_photo(inventory: Path, position: str) -> Path | None:
    """Return the published cover photo of a position; None without."""
    path = read_inventory(inventory).cover_photos.get(position)
    return resolve_from(path, inventory) if path else None
