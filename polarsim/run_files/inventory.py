"""`inventory.json`: what the source has for one terrain beside its photos, the same for every kind of source."""

from __future__ import annotations

from dataclasses import asdict, dataclass, field
from pathlib import Path

from polarsim.errors import FormatError
from polarsim.formats.files import read_json, write_json
from polarsim.formats.readers import reader


@dataclass(frozen=True)
class Inventory:
    """Paths as the configuration's root gives them; scans lie in the rectified left frame of their position."""

    terrain: int
    kind: str  # "analog", "release" or "polar"
    calibration: str = ""  # file that calibration.json was made from; empty: the stated rig
    range_maps: dict[str, str] = field(default_factory=dict)  # position -> PosX_org-XYZ.tif
    clouds: dict[str, str] = field(default_factory=dict)  # position -> PosX.xyz
    meshes: dict[str, str] = field(default_factory=dict)  # published rock id -> OBJ file
    ground: str = ""  # published ground mesh, where there is one
    cover_photos: dict[str, str] = field(default_factory=dict)  # position -> picture with ids drawn in
    stray: tuple[str, ...] = ()  # files that were left out, by name

    @property
    def scanned(self) -> list[str]:
        """Positions with a scan of any kind."""
        return sorted(set(self.range_maps) | set(self.clouds))

    def rock_meshes(self) -> dict[int, str]:
        """OBJ files of the published rocks by id, in the order of ids.

        Raises
        ------
        FormatError
            An id is no number.
        """
        if not all(name.isdigit() for name in self.meshes):
            raise FormatError(f"meshes are named by rock ids, found {sorted(self.meshes)[-1]!r}")
        return dict(sorted((int(name), path) for name, path in self.meshes.items()))


def write_inventory(path: str | Path, inventory: Inventory) -> None:
    write_json(path, asdict(inventory))


@reader("inventory")
def read_inventory(path: str | Path) -> Inventory:
    """Read an inventory.

    Raises
    ------
    FormatError
        The file is missing or has other keys.
    """
    content = read_json(path)
    try:
        return Inventory(**{**content, "stray": tuple(content.get("stray", ()))})
    except TypeError as error:
        raise FormatError(f"no inventory, {error}", path=path) from error
