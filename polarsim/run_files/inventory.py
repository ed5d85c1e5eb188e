"""`inventory.json`: raw files of a terrain other than photos, for any data source."""

from __future__ import annotations

from dataclasses import asdict, dataclass, field
from pathlib import Path

from polarsim.errors import FormatError
from polarsim.formats.files import read_json, write_json
from polarsim.formats.readers import reader
from polarsim.photo import Terrain


@dataclass(frozen=True)
class Inventory:
    """Paths below the root of the source. Scans are in the rectified left frame of the position."""

    terrain: Terrain
    kind: str  # "analog", "release" or "files"
    calibration: str = ""  # source file of calibration.json; empty: the default rig
    range_maps: dict[str, str] = field(default_factory=dict)  # position -> PosX_org-XYZ.tif
    clouds: dict[str, str] = field(default_factory=dict)  # position -> PosX.xyz
    meshes: dict[str, str] = field(default_factory=dict)  # published rock id -> OBJ file
    ground: str = ""  # published ground mesh, empty without
    cover_photos: dict[str, str] = field(default_factory=dict)  # position -> image with rock ids
    stray: tuple[str, ...] = ()  # names of skipped files

    @property
    def scanned(self) -> list[str]:
        """Positions with a range map or cloud."""
        return sorted(set(self.range_maps) | set(self.clouds))

    def rock_meshes(self) -> dict[int, str]:
        """Return the OBJ files of the published rocks by rock id, sorted by id."""
        if not all(name.isdigit() for name in self.meshes):
            raise FormatError(f"meshes has the key {sorted(self.meshes)[-1]!r}, expected rock ids")
        return dict(sorted((int(name), path) for name, path in self.meshes.items()))


def write_inventory(path: str | Path, inventory: Inventory) -> None:
    write_json(path, asdict(inventory))


@reader("inventory")
def read_inventory(path: str | Path) -> Inventory:
    """Read an inventory."""
    content = read_json(path)
    try:
        return Inventory(**{**content, "stray": tuple(content.get("stray", ()))})
    except TypeError as error:
        raise FormatError(f"no inventory, {error}", path=path) from error
