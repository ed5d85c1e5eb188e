"""Paths of NASA's photos, with the names of NASA's folders."""

from __future__ import annotations

from polarsim.formats.site_paths import format_path, photo_fields
from polarsim.photo import PhotoKey
from polarsim.site import polar


def photo_path(key: PhotoKey, token: str) -> str:
    """Return the path of a photo below the root: `Terrain11_FreshCrater/PosA_1500_Loff/Sun_30/CamL_TOKEN_0256.png`."""
    anys = [polar().options(key.terrain).name or "Unnamed", "1500", token]
    return format_path(polar(), polar().files.photos, key.terrain, photo_fields(key), anys)
