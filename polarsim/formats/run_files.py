"""The files of a run that belong to one photo."""

from __future__ import annotations

from pathlib import Path

from polarsim.formats.inventory import read_inventory
from polarsim.formats.tables import read_parquet
from polarsim.photo import PhotoKey


def photo_of(run: Path, key: PhotoKey) -> Path | None:
    """The raw photo of a key; None where the run's source has none."""
    photos = read_parquet(run / "acquire" / f"Terrain{key.terrain:02d}" / "photos.parquet", ["key", "path"])
    found = photos.loc[photos["key"] == str(key), "path"]
    return Path(str(found.iloc[0])) if len(found) else None


def cover_photo_of(run: Path, key: PhotoKey) -> Path | None:
    """The release's picture with rock ids drawn in, of the key's position; None where there is none."""
    inventory = read_inventory(run / "acquire" / f"Terrain{key.terrain:02d}" / "inventory.json")
    path = inventory.cover_photos.get(key.position)
    return Path(path) if path else None


def twin_of(run: Path, model: str, key: PhotoKey) -> Path:
    return run / "renders" / model / f"Terrain{key.terrain:02d}" / f"{key}.png"


def pictures_of(run: Path, domain: str, terrain: int) -> dict[PhotoKey, Path]:
    """A terrain's photos (domain `photo`) or twins of a model, by key; empty where the run has none."""
    folder = f"Terrain{terrain:02d}"
    if domain == "photo":
        photos = read_parquet(run / "acquire" / folder / "photos.parquet", ["key", "path"])
        return {
            PhotoKey.parse(str(key)): Path(str(path)) for key, path in zip(photos["key"], photos["path"], strict=True)
        }
    return {PhotoKey.parse(path.stem): path for path in sorted((run / "renders" / domain / folder).glob("*.png"))}


def polygons_of(run: Path, key: PhotoKey) -> Path:
    """Outlines of the labels that were carried to a photo."""
    return run / "labels" / "polygons" / f"Terrain{key.terrain:02d}" / f"{key}.txt"


def instances_of(run: Path, key: PhotoKey) -> Path:
    """What the twins of a photo set show, pixel by pixel."""
    photo_set = str(key).rpartition("_")[0]
    return run / "renders" / "instances" / f"Terrain{key.terrain:02d}" / f"{photo_set}.png"
