"""Files of the terrains of a run that exist, for `polarsim check-site`."""

from __future__ import annotations

from dataclasses import dataclass

from polarsim.acquire.converted import read_stored
from polarsim.acquire.value_range import saturated_value
from polarsim.config import Config
from polarsim.formats import site_files
from polarsim.formats.calibrations import read_calibration
from polarsim.formats.png import read_photo
from polarsim.grid import selected_grid
from polarsim.photo import NO_SUN, terrain_text
from polarsim.site import Site
from polarsim.sources.files import stray_text


@dataclass(frozen=True)
class FoundFiles:
    """Files of a terrain that were found below the root, and the number of photos of the site."""

    terrain: str
    photos: int
    expected: int
    stray: int  # number of files that are no photos of the site
    format: str  # bits and colour of the photos
    notes: tuple[str, ...]  # example of a stray file, and saturation below the white level of the site
    scans: tuple[str, ...]  # positions
    calibration: str


def found_files(config: Config) -> list[FoundFiles]:
    """Return the files of each terrain of the run; an invalid calibration or examined photo is an error."""
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
        form, notes = _photo_format(site, photos)
        if strays:
            notes.insert(0, stray_text(site, root, strays))
        found.append(
            FoundFiles(
                terrain_text(terrain), count, expected, len(strays), form, tuple(notes), tuple(sorted(scans)), name
            )
        )
    return found


def _photo_format(site: Site, photos: site_files.Photos) -> tuple[str, list[str]]:
    """Return bits and colour of a photo of each camera, and notes on values that do not fit the site.

    The photo is one of the longest exposures under a lamp, which has the largest values.

    Raises
    ------
    FormatError
        The size, the bits or the largest value differ from those of the site.
    """
    forms: dict[str, str] = {}
    notes = []
    for camera in site.cameras.sides:
        of_camera = [(key.azimuth != NO_SUN, key.exposure_ms, path) for key, path in photos if key.camera == camera]
        if not of_camera:
            continue
        path = max(of_camera)[-1]
        pixels = read_stored(path, site.images) if site.converts_photos else read_photo(path, site.images.size)
        colour = "colour, converted to grey" if pixels.ndim == 3 else "grey"
        forms[camera] = f"{8 * pixels.itemsize} bits, {colour}"
        white = saturated_value([pixels])
        if white not in (None, site.images.white_level):
            notes.append(
                f"{path} is saturated at {white}, expected {site.images.white_level} (images.bits and images.white of "
                "the site)"
            )
    if len(set(forms.values())) > 1:
        return "; ".join(f"{camera}: {form}" for camera, form in forms.items()), notes
    return next(iter(forms.values()), "none"), notes
