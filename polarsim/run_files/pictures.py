"""Photos and twins by key, from tables and folders that are inputs of a rule; `run_files.run` reads a whole run."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from pathlib import Path

from polarsim.errors import FormatError
from polarsim.formats.files import found_from
from polarsim.formats.readers import reader
from polarsim.formats.tables import read_parquet
from polarsim.photo import PhotoKey
from polarsim.run_files.inventory import read_inventory

STRIP_TEXT = "strip.json"  # in the folder of a photo's strip: its key, and name and caption of each panel


@reader("pictures")
def pictures_at(folder: Path) -> dict[PhotoKey, Path]:
    """Return the pictures by key: of a table of photos (see `found_from`), or of a folder of twins.

    Raises
    ------
    FormatError
        A missing table or folder, a string in place of a path, a PNG whose name is no photo key.
    """
    if not isinstance(folder, Path):  # a string given as a list of paths arrives here character by character
        raise TypeError(f"{folder!r} is a {type(folder).__name__}, expected a pathlib.Path")
    if folder.suffix != ".parquet":
        if not folder.is_dir():
            raise FormatError("no such folder of pictures", path=folder)
        return {PhotoKey.parse(path.stem): path for path in sorted(folder.glob("*.png"))}
    photos = read_parquet(folder, ["key", "path"])
    stated = {
        PhotoKey.parse(str(key)): Path(str(path)) for key, path in zip(photos["key"], photos["path"], strict=True)
    }
    if not stated:
        return stated
    first = next(iter(stated.values()))
    found = found_from(first, folder)
    root = Path(str(found).removesuffix(str(first)))  # one look for all: they are below one folder
    return {key: root / path for key, path in stated.items()}


def picture_finder(photo_domain: str, folders: Iterable[Path]) -> Callable[[str, PhotoKey], Path | None]:
    """What finds the picture of a domain and a key.

    Parameters
    ----------
    photo_domain
        Domain of the photos.
    folders
        Tables of photos, and folders of twins `<domain>/TerrainTT`.
    """
    found: dict[str, dict[PhotoKey, Path]] = {}
    for folder in folders:
        pictures = pictures_at(folder)
        domain = photo_domain if folder.suffix == ".parquet" else folder.parent.name
        found.setdefault(domain, {}).update(pictures)
    return lambda domain, key: found.get(domain, {}).get(key)


@reader("inventory")
def cover_photo(inventory: Path, position: str) -> Path | None:
    """The release's picture of a position with rock ids drawn in; None where there is none."""
    path = read_inventory(inventory).cover_photos.get(position)
    return found_from(path, inventory) if path else None
