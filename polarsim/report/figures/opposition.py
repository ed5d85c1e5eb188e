"""Figure of the opposition effect: crops of photo and twins at the smallest and at the largest phase angle.

The phase angle at a point of the ground is the angle between the directions to the lamp and to the camera. Near 0, the
surface hides the shadows it casts and is brightest.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from polarsim.formats import png
from polarsim.formats.files import write_json
from polarsim.geometry.lens import HALF_PIXEL
from polarsim.geometry.poses import Pose
from polarsim.photo import BLACK_LEVEL, WHITE_LEVEL, PhotoKey, Terrain
from polarsim.report import paper
from polarsim.report.figures.canvas import FIGURE_WIDTH, figure_title, note, page
from polarsim.run_files.lamps import read_suns
from polarsim.run_files.pictures import picture_finder
from polarsim.run_files.rigs import LocalisedRig, read_all_localised
from polarsim.site import Site
from polarsim.tone import display_white_level, to_8bit
from polarsim.wording import enumerated

NEAR_DEG = 10.0  # maximum phase angle at which the surge is visible (h_s of Sato et al. 2014: 4 degrees)
HALF_PX = 140  # half the side of the crops
_WELL_EXPOSED_DN = 1000.0  # preferred median of a crop above black
_ROW_PX = 60  # height of titles
STEP_PX = 16  # step between tested pixels
WALL_MARGIN = 0.8  # excluded margin of sand along the walls, metres, so that crops show ground only


@dataclass(frozen=True)
class PhasePixel:
    """A pixel of a photo and the phase angle of the ground at this pixel."""

    key: PhotoKey
    u: float
    v: float
    phase_deg: float


def lit_by_single_lamp(key: PhotoKey) -> bool:
    """Return whether exactly one of Sun lamp and rover light is on, so that the phase angle is defined."""
    return key.has_sun != (key.light == "on")


def extreme_spots(
    site: Site, terrain: Terrain, keys: list[PhotoKey], cameras: Path, half_px: int
) -> tuple[PhasePixel, PhasePixel] | None:
    """Return the spots of the smallest and of the largest phase angle in photos lit by a single lamp, or None.

    `keys`: photos of the terrain. `cameras` is the folder of its poses and lamps, `half_px` the minimum distance of a
    spot from the border.
    """
    rigs = read_all_localised(cameras)
    half = np.array(site.sandbox_of(terrain).half_width_m)
    lamps = read_suns(cameras, rigs, site, terrain)
    spots: dict[tuple[object, ...], tuple[PhasePixel, PhasePixel]] = {}
    for key in sorted(keys):
        if key.position not in rigs or not lit_by_single_lamp(key) or key.bracket in spots:
            continue
        rig = rigs[key.position]
        lamp = lamps.get(key.azimuth)
        if key.light == "on":
            lamp = rig.rover_light(site.rig_lamp) if site.rig_lamp else None
        angles = None if lamp is None else _angles(rig, key, lamp, half, half_px)
        if angles is not None:
            spots[key.bracket] = angles
    if not spots:
        return None
    smallest = min((near for near, _ in spots.values()), key=lambda spot: (spot.phase_deg, spot.key))
    largest = max((far for _, far in spots.values()), key=lambda spot: (spot.phase_deg, spot.key))
    return smallest, largest


def phase_angles(
    sandbox_from_camera: Pose, directions: np.ndarray, lamp_sandbox: np.ndarray, half: np.ndarray
) -> np.ndarray:
    """Return the phase angles (...), radians, where camera directions (..., 3) intersect the plane z = 0.

    The result is NaN outside the sandbox, of half widths `half` (2,), metres, and within `WALL_MARGIN` of the walls.
    """
    rays = sandbox_from_camera.rotate(directions)
    eye = sandbox_from_camera.translation
    with np.errstate(divide="ignore", invalid="ignore"):
        distance = np.where(rays[..., 2] < 0, -eye[2] / rays[..., 2], np.nan)
    ground = eye + distance[..., None] * rays
    inside = (np.abs(ground[..., :2]) <= half - WALL_MARGIN).all(axis=-1)
    to_eye, to_lamp = eye - ground, lamp_sandbox - ground
    sine = np.linalg.norm(np.cross(to_eye, to_lamp), axis=-1)
    return np.where(inside, np.arctan2(sine, (to_eye * to_lamp).sum(axis=-1)), np.nan)


def _angles(
    rig: LocalisedRig, key: PhotoKey, lamp: np.ndarray, half: np.ndarray, half_px: int
) -> tuple[PhasePixel, PhasePixel] | None:
    lens = rig.rig.lens(key.camera)
    u = np.arange(half_px, lens.width - half_px, STEP_PX) + HALF_PIXEL
    v = np.arange(half_px, lens.height - half_px, STEP_PX) + HALF_PIXEL
    pixels = np.stack(np.meshgrid(u, v), axis=-1).reshape(-1, 2)
    angles = np.degrees(phase_angles(rig.sandbox_from(key.camera), lens.directions(pixels), lamp, half))
    if np.isnan(angles).all():
        return None
    smallest, largest = (
        PhasePixel(key, float(pixels[at, 0]), float(pixels[at, 1]), float(angles[at]))
        for at in (np.nanargmin(angles), np.nanargmax(angles))
    )
    return smallest, largest


def draw_opposition(
    *,
    site: Site,
    keys: Sequence[PhotoKey],
    cameras: Mapping[Terrain, Path],
    photo_domain: str,
    models: Sequence[str],
    pictures: Iterable[Path],
    figure: Path,
    text: Path,
    width: int = FIGURE_WIDTH,
) -> None:
    """Write the figure and a JSON file with the caption, or the reason for an empty figure.

    Rows: smallest and largest phase angle; columns: photo and twins. The crops of a row have the same white level, that
    of the brightest crop, so that brightness can be compared; the median is written below each crop. The terrain with
    the smallest phase angle of all `keys` is shown. `pictures` are tables of photos and folders of twins, see
    `picture_finder`.
    """
    domains, picture_of = [photo_domain, *models], picture_finder(photo_domain, pictures)
    available = [key for key in keys if all((path := picture_of(domain, key)) and path.exists() for domain in domains)]
    spots = _best_terrain_spots(site, available, cameras)
    reason = _reason_for_none(spots)
    if spots is None or reason:
        with page(figure, width, 300) as sheet:
            note(sheet, reason)
        write_json(text, {"shown": False, "text": reason})
        return
    cell = width // len(domains)
    shown: list[tuple[list[np.ndarray], PhasePixel, PhotoKey]] = []
    with page(figure, width, 2 * (cell + _ROW_PX)) as sheet:
        figure_title(sheet, "Brightness at the smallest and the largest phase angle, same white level within a row")
        grid = sheet.subplots(2, len(domains), squeeze=False)
        for axes, spot in zip(grid, spots, strict=True):
            bracket = [key for key in available if key.bracket == spot.key.bracket]
            crops_of = {key: [_crop(picture_of(domain, key), spot) for domain in domains] for key in bracket}
            key = min(crops_of, key=lambda key: (_exposure_rank(crops_of[key]), key))
            crops = crops_of[key]
            _draw_row(axes, crops, domains, spot, key)
            shown.append((crops, spot, key))
    texts = [_caption(crops, domains, spot, key) for crops, spot, key in shown]
    (near, *_), (far, *_) = shown
    texts += _conclusion(near, far, domains)
    write_json(text, {"shown": True, "text": " ".join(texts).removesuffix(".")})


def _reason_for_none(spots: tuple[PhasePixel, PhasePixel] | None) -> str:
    """Return the reason for an empty figure, or "" if there are spots to show."""
    if spots is None:
        return "No photo of this run that has twins is lit by a single lamp, so no phase angle is defined"
    smallest = spots[0]
    if smallest.phase_deg <= NEAR_DEG:
        return ""
    return (
        f"The smallest phase angle in this run is {smallest.phase_deg:.1f} degrees ({smallest.key}), too large for the "
        f"opposition surge (less than {NEAR_DEG:g} degrees)"
    )


def _best_terrain_spots(
    site: Site, keys: Sequence[PhotoKey], cameras: Mapping[Terrain, Path]
) -> tuple[PhasePixel, PhasePixel] | None:
    """Return the spots of the first terrain with the smallest phase angle, rounded to 0.1 degrees."""
    candidates = [
        extreme_spots(site, terrain, [key for key in keys if key.terrain == terrain], folder, HALF_PX)
        for terrain, folder in sorted(cameras.items())
    ]
    return min((spots for spots in candidates if spots), key=lambda spots: round(spots[0].phase_deg, 1), default=None)


def _exposure_rank(crops: Sequence[np.ndarray]) -> tuple[int, float]:
    """Return the number of clipped or black crops, and the maximum distance from a middle grey, stops."""
    unusable = sum(not _is_usable(_signal(crop)) for crop in crops)
    return unusable, max(abs(float(np.log2(max(_signal(crop), 1.0) / _WELL_EXPOSED_DN))) for crop in crops)


def _crop(path: Path | None, spot: PhasePixel) -> np.ndarray:
    assert path is not None, "called for available images only"
    left, top = int(spot.u) - HALF_PX, int(spot.v) - HALF_PX
    return png.read_png(path)[top : top + 2 * HALF_PX, left : left + 2 * HALF_PX]


def _signal(crop: np.ndarray) -> float:
    """Return the median of a crop, DN above black."""
    return float(np.median(crop.astype(float)) - BLACK_LEVEL)


def _is_usable(signal: float) -> bool:
    """Return whether a median, DN above black, is neither black nor clipped."""
    return 1 <= signal < WHITE_LEVEL - BLACK_LEVEL


def _draw_row(axes: Any, crops: list[np.ndarray], domains: Sequence[str], spot: PhasePixel, key: PhotoKey) -> None:
    white, photo = max(map(display_white_level, crops)), _signal(crops[0])
    for panel, domain, crop in zip(axes, domains, crops, strict=True):
        panel.imshow(to_8bit(crop, white), interpolation="antialiased")
        panel.set_xticks([])
        panel.set_yticks([])
        panel.set_title(paper.domain_title(domain))
        ratio = "" if panel is axes[0] else f", {_signal(crop) / photo:.2g} times the photo"
        panel.set_xlabel(
            f"median {_signal(crop):.0f} DN{ratio if _is_usable(photo) and _is_usable(_signal(crop)) else ''}"
        )
    axes[0].set_ylabel(f"phase {spot.phase_deg:.1f}°\n{key}", fontsize="small")


def _caption(crops: list[np.ndarray], domains: Sequence[str], spot: PhasePixel, key: PhotoKey) -> str:
    """Return a sentence on the brightness of the twins relative to the photo, or on clipped and black crops."""
    photo = _signal(crops[0])
    start = f"At a phase angle of {spot.phase_deg:.1f} degrees ({key})"
    signals = {domain: _signal(crop) for domain, crop in zip(domains[1:], crops[1:], strict=True)}
    unusable = [domain for domain, signal in {domains[0]: photo, **signals}.items() if not _is_usable(signal)]
    if unusable:
        names = enumerated(map(paper.domain_title, unusable))
        return f"{start}, the median of {names} is clipped or black: no comparison."
    ratios = enumerated(f"{signal / photo:.2f} ({paper.domain_title(domain)})" for domain, signal in signals.items())
    return f"{start}, the ratio of the crop's median to that of {paper.domain_title(domains[0])} is {ratios}."


def _conclusion(near: Sequence[np.ndarray], far: Sequence[np.ndarray], domains: Sequence[str]) -> list[str]:
    """Return a sentence on the change of the ratios between the phase angles; empty without two ratios of a twin."""
    signals = {
        domain: [_signal(near[0]), _signal(far[0]), _signal(first), _signal(second)]
        for domain, first, second in zip(domains[1:], near[1:], far[1:], strict=True)
    }
    changes = [
        f"{max(change, 1 / change):.2g} ({paper.domain_title(domain)})"
        for domain, values in signals.items()
        if all(map(_is_usable, values)) and (change := values[2] * values[1] / (values[0] * values[3]))
    ]
    if not changes:
        return []
    return [
        f"Between the two angles the ratio changes by a factor of {enumerated(changes)}: 1 for a reflectance model "
        "with the phase curve of the photos."
    ]
