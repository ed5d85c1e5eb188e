"""NASA's photos and scans."""

from __future__ import annotations

import logging
import re
from collections.abc import Collection, Sequence
from pathlib import Path

from polarsim.errors import FetchError, FormatError
from polarsim.formats import nasa
from polarsim.grid import GridOptions, selected_grid
from polarsim.photo import PhotoKey
from polarsim.run_files.inventory import Inventory
from polarsim.sources.source import TerrainContent, below, path_texts

log = logging.getLogger("polarsim")

_PHOTO = "PosA_1500_Loff/Sun_30/CamL_7_0256.png"  # example of a photo's path


class NasaSource:
    """Photos of the real sandbox, its scans and calibration."""

    kind = "polar"
    domain = "real"
    has_photos = True
    has_scans = True
    is_generated = False
    layout = re.compile("|".join([r"Terrain\d\d.*", r"Pos[A-G].*", nasa.RANGE_FOLDER]))

    def expected(self, terrain: int) -> str:
        """Return the names of the folders that a terrain has."""
        return f"Terrain{terrain:02d}_* and {nasa.RANGE_FOLDER}/Terrain{terrain:02d}"

    def folders(self, root: Path, terrain: int) -> list[Path]:
        """Return the folder of photos and those of scans."""
        folder = nasa.find_terrain_folder(root, terrain)
        range_maps, _ = nasa.find_scans(root, terrain)
        return sorted({*([folder] if folder else []), *(path.parent for path in range_maps.values())})

    def inputs(self, root: Path, terrain: int) -> list[Path]:
        """Return the calibration and the scans."""
        folder = nasa.find_terrain_folder(root, terrain)
        range_maps, clouds = nasa.find_scans(root, terrain)
        calibration = nasa.find_calibration(folder) if folder else None
        return [*([calibration] if calibration else []), *range_maps.values(), *clouds.values()]

    def index(self, root: Path, terrain: int, positions: Sequence[str], grid: GridOptions) -> TerrainContent:
        """Return the inventory and the photos of a terrain."""
        range_maps, clouds = nasa.find_scans(root, terrain)
        folder = nasa.find_terrain_folder(root, terrain)
        if folder is None and not range_maps:
            raise FormatError(f"nothing of terrain {terrain:02d}, looked for {self.expected(terrain)}", path=root)
        found = nasa.find_photos(folder, terrain) if folder else []
        photos = [(key, path) for key, path in found if key.position in positions]
        log_gaps([key for key, _ in photos], selected_grid(terrain, positions, grid), folder or root)
        stated = nasa.find_calibration(folder) if folder else None
        if stated is None:
            log.warning("%s: no %s, the rig of terrain 11 is taken", folder or root, nasa.CALIBRATION_NAME)
        inventory = Inventory(
            terrain,
            self.kind,
            calibration=stated.as_posix() if stated else "",
            range_maps=path_texts({name: path for name, path in range_maps.items() if name in positions}),
            clouds=path_texts({name: path for name, path in clouds.items() if name in positions}),
            stray=below(root, nasa.find_strays(folder, terrain) if folder else []),
        )
        return TerrainContent(inventory, photos)

    def truth(self, root: Path, terrain: int) -> Path | None:  # noqa: ARG002
        """Return None: nobody measured the real sandbox."""
        return None

    def unpacked(self, root: Path, terrain: int) -> Path | None:
        """Return the folder of a terrain's photos."""
        return nasa.find_terrain_folder(root, terrain)

    def arrange(self, unpacked: Path, root: Path) -> None:
        """Leave an unpacked archive as it is: scans and photos are found in any folder of the root."""

    def check_fetched(self, root: Path, terrain: int, files: Sequence[Path]) -> None:
        """Check that a terrain's folder has photos, scans or a calibration."""
        folder = nasa.find_terrain_folder(root, terrain)
        if folder is None:
            return
        photos, strays = nasa.find_photos(folder, terrain), nasa.find_strays(folder, terrain)
        if strays and not photos:
            raise FetchError(f"no photo, expected {_PHOTO} or one folder deeper", path=strays[0])
        if not photos and not any(nasa.find_scans(root, terrain)) and nasa.find_calibration(folder) is None:
            raise FetchError(
                f"no photo, scan or {nasa.CALIBRATION_NAME} of terrain {terrain:02d}, such as {_PHOTO}; "
                f"found {len(files)} other files, such as {files[0].relative_to(root)}",
                path=folder,
            )


def log_gaps(keys: Collection[PhotoKey], expected: Sequence[PhotoKey], folder: Path) -> None:
    """Log one warning if photos of the grid, or the other camera's photos, are missing."""
    there = set(keys)
    missing = [key for key in expected if key not in there]
    unpaired = [key for key in sorted(there) if key.other_camera not in there]
    if not there:
        log.warning("%s: no photo", folder)
    elif missing or unpaired:
        log.warning(
            "%s: %d photos found, %d of the grid missing, %d without the other camera's, such as %s",
            folder, len(there), len(missing), len(unpaired), (*unpaired, *missing)[0],
        )  # fmt: skip
