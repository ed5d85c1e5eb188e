"""Photos, scans and calibrations of any site, with the file names of `site.files`."""

from __future__ import annotations

import logging
import re
from collections.abc import Collection, Sequence
from pathlib import Path

from polarsim.errors import FetchError, FormatError
from polarsim.formats import site_files
from polarsim.grid import GridOptions, selected_grid
from polarsim.photo import PhotoKey, Terrain, terrain_text
from polarsim.run_files.inventory import Inventory
from polarsim.site import Site
from polarsim.sources.source import TerrainContent, path_texts, relative_names
from polarsim.wording import counted

log = logging.getLogger("polarsim")


class FilesSource:
    """Photos, scans and calibrations in the layout of the site."""

    kind = "files"
    domain = "real"
    has_photos = True
    has_scans = True
    is_generated = False

    def layout(self, site: Site) -> re.Pattern[str]:
        """Return the names of the top folders of archives."""
        return site_files.archive_layout(site)

    def expected(self, site: Site, terrain: Terrain) -> str:
        """Return the names of the folders of a terrain."""
        return " and ".join(site_files.expected_folders(site, terrain))

    def folders(self, site: Site, root: Path, terrain: Terrain) -> list[Path]:
        """Return the folders of photos and scans."""
        found = {site_files.find_terrain_folder(site, root, text, terrain) for text in site_files.patterns_of(site)}
        return sorted(folder for folder in found if folder is not None)

    def inputs(self, site: Site, root: Path, terrain: Terrain) -> list[Path]:
        """Return the calibration and the scans."""
        calibration = site_files.find_calibration(site, root, terrain)
        scans = site_files.find_range_maps(site, root, terrain), site_files.find_clouds(site, root, terrain)
        return [*([calibration] if calibration else []), *(path for found in scans for path in found.values())]

    def index(
        self, site: Site, root: Path, terrain: Terrain, positions: Sequence[str], grid: GridOptions
    ) -> TerrainContent:
        """Return the inventory and the photos of a terrain."""
        if not self.folders(site, root, terrain):
            raise FormatError(
                f"no data of terrain {terrain_text(terrain)}, expected {self.expected(site, terrain)}", path=root
            )
        folder = site_files.find_terrain_folder(site, root, site.files.photos, terrain)
        range_maps = site_files.find_range_maps(site, root, terrain)
        clouds = site_files.find_clouds(site, root, terrain)
        all_photos, strays = site_files.find_photos(site, root, terrain)
        if strays:
            log.warning("%s: %s", root, stray_text(site, root, strays))
        photos = [(key, path) for key, path in all_photos if key.position in positions]
        selected = selected_grid(site, terrain, positions, grid)
        log_gaps([key for key, _ in photos], selected, folder or root, stereo=site.cameras.stereo)
        stated = site_files.find_calibration(site, root, terrain)
        if stated is None and site.files.calibration:
            name = site.files.calibration.rsplit("/", 1)[-1]
            log.warning("%s: no %s, using the calibration of the site", folder or root, name)
        inventory = Inventory(
            terrain,
            self.kind,
            calibration=stated.as_posix() if stated else "",
            range_maps=path_texts({name: path for name, path in range_maps.items() if name in positions}),
            clouds=path_texts({name: path for name, path in clouds.items() if name in positions}),
            stray=relative_names(root, strays),
        )
        return TerrainContent(inventory, photos)

    def truth(self, root: Path, terrain: Terrain) -> Path | None:  # noqa: ARG002
        """Return None: real data have no ground truth."""
        return None

    def unpacked(self, site: Site, root: Path, terrain: Terrain) -> Path | None:
        """Return the folder of the photos of a terrain; None if it is not a folder of that terrain alone."""
        folder = site_files.find_terrain_folder(site, root, site.files.photos, terrain)
        return None if folder == root else folder

    def arrange(self, unpacked: Path, root: Path) -> None:
        """Do nothing: photos and scans may be in any folder of the root."""

    def check_fetched(self, site: Site, root: Path, terrain: Terrain, files: Sequence[Path]) -> None:
        """Check that the folder of a terrain has photos, scans or a calibration."""
        folder = site_files.find_terrain_folder(site, root, site.files.photos, terrain)
        if folder is None:
            return
        photos, strays = site_files.find_photos(site, root, terrain)
        expected = site.files.photos
        if strays and not photos:
            raise FetchError(f"not the path of a photo, expected {expected}, also in a subfolder", path=strays[0])
        if not photos and not self.inputs(site, root, terrain):
            raise FetchError(
                f"no photo, scan or calibration of terrain {terrain_text(terrain)}, such as {expected}; the archive "
                f"has {len(files)} other files, such as {files[0].relative_to(root)}",
                path=folder,
            )


def stray_text(site: Site, root: Path, strays: Sequence[Path]) -> str:
    """Return the number of stray files of a terrain and a name, and the reason why they are no photos."""
    return (
        f"{counted(len(strays), 'file')} skipped, such as {strays[0].relative_to(root).as_posix()}: expected "
        f"{site.files.photos} with positions, lamps and exposures of the site"
    )


def log_gaps(keys: Collection[PhotoKey], expected: Sequence[PhotoKey], folder: Path, *, stereo: bool) -> None:
    """Log a warning if photos of the grid or, with two cameras, of the second camera are missing."""
    available = set(keys)
    missing = [key for key in expected if key not in available]
    unpaired = [key for key in sorted(available) if key.other_camera not in available] if stereo else []
    if not available:
        log.warning("%s: no photo", folder)
    elif missing or unpaired:
        second = f", {len(unpaired)} without the photo of the second camera" if stereo else ""
        log.warning(
            "%s: %d photos found, %d of the grid missing%s, such as %s",
            folder, len(available), len(missing), second, (*unpaired, *missing)[0],
        )  # fmt: skip
