"""NASA's photos and scans."""

from __future__ import annotations

import logging
import re
from collections.abc import Collection, Sequence
from pathlib import Path

from polarsim.errors import FetchError, FormatError
from polarsim.formats import nasa_layout
from polarsim.grid import GridOptions, selected_grid
from polarsim.photo import PhotoKey, Terrain, terrain_text
from polarsim.run_files.inventory import Inventory
from polarsim.site import Site
from polarsim.sources.source import TerrainContent, path_texts, relative_names

log = logging.getLogger("polarsim")

_PHOTO = "PosA_1500_Loff/Sun_30/CamL_7_0256.png"  # example of the path of a photo


class NasaSource:
    """Photos, scans and calibrations of the real sandbox."""

    kind = "polar"
    domain = "real"
    has_photos = True
    has_scans = True
    is_generated = False
    layout = re.compile("|".join([r"Terrain\d\d.*", r"Pos[A-G].*", nasa_layout.RANGE_FOLDER]))

    def expected(self, terrain: Terrain) -> str:
        """Return the names of the folders of a terrain."""
        return f"Terrain{terrain_text(terrain)}_* and {nasa_layout.RANGE_FOLDER}/Terrain{terrain_text(terrain)}"

    def folders(self, root: Path, terrain: Terrain) -> list[Path]:
        """Return the folders of photos and scans."""
        folder = nasa_layout.find_terrain_folder(root, terrain)
        range_maps, _ = nasa_layout.find_scans(root, terrain)
        return sorted({*([folder] if folder else []), *(path.parent for path in range_maps.values())})

    def inputs(self, root: Path, terrain: Terrain) -> list[Path]:
        """Return the calibration and the scans."""
        folder = nasa_layout.find_terrain_folder(root, terrain)
        range_maps, clouds = nasa_layout.find_scans(root, terrain)
        calibration = nasa_layout.find_calibration(folder) if folder else None
        return [*([calibration] if calibration else []), *range_maps.values(), *clouds.values()]

    def index(
        self, site: Site, root: Path, terrain: Terrain, positions: Sequence[str], grid: GridOptions
    ) -> TerrainContent:
        """Return the inventory and the photos of a terrain."""
        range_maps, clouds = nasa_layout.find_scans(root, terrain)
        folder = nasa_layout.find_terrain_folder(root, terrain)
        if folder is None and not range_maps:
            raise FormatError(
                f"no data of terrain {terrain_text(terrain)}, expected {self.expected(terrain)}", path=root
            )
        all_photos = nasa_layout.find_photos(folder, terrain) if folder else []
        photos = [(key, path) for key, path in all_photos if key.position in positions]
        log_gaps([key for key, _ in photos], selected_grid(site, terrain, positions, grid), folder or root)
        stated = nasa_layout.find_calibration(folder) if folder else None
        if stated is None:
            log.warning("%s: no %s, using the rig of terrain 11", folder or root, nasa_layout.CALIBRATION_NAME)
        inventory = Inventory(
            terrain,
            self.kind,
            calibration=stated.as_posix() if stated else "",
            range_maps=path_texts({name: path for name, path in range_maps.items() if name in positions}),
            clouds=path_texts({name: path for name, path in clouds.items() if name in positions}),
            stray=relative_names(root, nasa_layout.find_strays(folder, terrain) if folder else []),
        )
        return TerrainContent(inventory, photos)

    def truth(self, root: Path, terrain: Terrain) -> Path | None:  # noqa: ARG002
        """Return None: the real sandbox has no ground truth."""
        return None

    def unpacked(self, root: Path, terrain: Terrain) -> Path | None:
        """Return the folder of the photos of a terrain."""
        return nasa_layout.find_terrain_folder(root, terrain)

    def arrange(self, unpacked: Path, root: Path) -> None:
        """Do nothing: photos and scans may be in any folder of the root."""

    def check_fetched(self, root: Path, terrain: Terrain, files: Sequence[Path]) -> None:
        """Check that the folder of a terrain has photos, scans or a calibration."""
        folder = nasa_layout.find_terrain_folder(root, terrain)
        if folder is None:
            return
        photos, strays = nasa_layout.find_photos(folder, terrain), nasa_layout.find_strays(folder, terrain)
        if strays and not photos:
            raise FetchError(f"not the path of a photo, expected {_PHOTO} or a subfolder with it", path=strays[0])
        if (
            not photos
            and not any(nasa_layout.find_scans(root, terrain))
            and nasa_layout.find_calibration(folder) is None
        ):
            raise FetchError(
                f"no photo, scan or {nasa_layout.CALIBRATION_NAME} of terrain {terrain_text(terrain)}, "
                f"such as {_PHOTO}; the archive has {len(files)} other files, such as {files[0].relative_to(root)}",
                path=folder,
            )


def log_gaps(keys: Collection[PhotoKey], expected: Sequence[PhotoKey], folder: Path) -> None:
    """Log a warning if photos of the grid or of the second camera are missing."""
    available = set(keys)
    missing = [key for key in expected if key not in available]
    unpaired = [key for key in sorted(available) if key.other_camera not in available]
    if not available:
        log.warning("%s: no photo", folder)
    elif missing or unpaired:
        log.warning(
            "%s: %d photos found, %d of the grid missing, %d without the photo of the second camera, such as %s",
            folder, len(available), len(missing), len(unpaired), (*unpaired, *missing)[0],
        )  # fmt: skip
