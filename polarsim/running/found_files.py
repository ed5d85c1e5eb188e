"""Files of the terrains of a run that exist, for `polarsim check-site`."""

from __future__ import annotations

from dataclasses import dataclass

from polarsim.config import Config
from polarsim.formats import site_files
from polarsim.formats.calibrations import read_calibration
from polarsim.grid import selected_grid
from polarsim.photo import terrain_text
from polarsim.sources.files import stray_text


@dataclass(frozen=True)
class FoundFiles:
    """Files of a terrain that were found below the root, and the number of photos of the site."""

    terrain: str
    photos: int
    expected: int
    stray: int  # number of files that are no photos of the site
    note: str  # example of a stray file, or empty
    scans: tuple[str, ...]  # positions
    calibration: str


def found_files(config: Config) -> list[FoundFiles]:
    """Return the files of each terrain of the run; an invalid calibration is an error."""
    site, root, found = config.site, config.source.root, []
    for terrain in config.terrains:
        photos, strays = site_files.find_photos(site, root, terrain)
        scans = {**site_files.find_range_maps(site, root, terrain), **site_files.find_clouds(site, root, terrain)}
        calibration = site_files.find_calibration(site, root, terrain)
        if calibration is not None:
            read_calibration(calibration, site)
        selected = set(selected_grid(site, terrain, config.positions, config.grid))
        expected, count = len(selected), len(selected & {key for key, _ in photos})
        name = calibration.name if calibration else "of the site" if site.cameras.calibration else "none"
        note = stray_text(site, root, strays) if strays else ""
        found.append(FoundFiles(terrain_text(terrain), count, expected, len(strays), note, tuple(sorted(scans)), name))
    return found
