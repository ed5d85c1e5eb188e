"""Opposition effect: crops of photo and twins where the lamp stands behind the camera, and far from it.

A phase angle lies between the ways to the lamp and to the camera, seen from the ground. Where it is near 0 a surface
hides its own shadows and is at its brightest.
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
from polarsim.photo import BLACK_LEVEL, WHITE_LEVEL, PhotoKey
from polarsim.report import paper
from polarsim.report.figures.canvas import FIGURE_WIDTH, note, page
from polarsim.run_files.lamps import read_suns
from polarsim.run_files.pictures import picture_finder
from polarsim.run_files.rigs import LocalisedRig, read_all_localised
from polarsim.survey import SANDBOX_HALF_WIDTH
from polarsim.tone import to_8bit, white_of

NEAR_DEG = 10.0  # farther from opposition nothing of its surge is left to see (h_s of Sato et al. 2014: 4 degrees)
HALF_PX = 140  # of the crops
_WELL_EXPOSED_DN = 1000.0  # median of the crop above black
_ROW_PX = 60  # of titles
STEP_PX = 16  # between the pixels that are asked
WALL_MARGIN = 0.8  # metres of sand before the walls that are not asked: crops shall show ground


@dataclass(frozen=True)
class Spot:
    """A pixel of a photo, and the phase angle of the ground there."""

    key: PhotoKey
    u: float
    v: float
    phase_deg: float


def lit_by_one_lamp(key: PhotoKey) -> bool:
    """Whether a Sun lamp or the rover light is on, and not both: only then a point has one phase angle."""
    return (key.azimuth != "no") != (key.light == "on")


def extreme_spots(keys: list[PhotoKey], cameras: Path, half_px: int) -> tuple[Spot, Spot] | None:
    """The spots of the smallest and of the largest phase angle in photos that one lamp lights; None without any.

    Parameters
    ----------
    keys
        Of one terrain.
    cameras
        Folder of its rig poses and lamps.
    half_px
        A window of this reach around the point lies in the photo.
    """
    rigs = read_all_localised(cameras)
    lamps = read_suns(cameras, rigs)
    found: dict[tuple[object, ...], tuple[Spot, Spot]] = {}
    for key in sorted(keys):
        if key.position not in rigs or not lit_by_one_lamp(key) or key.bracket in found:
            continue
        rig = rigs[key.position]
        lamp = lamps.get(key.azimuth) if key.light == "off" else rig.rover_light
        angles = None if lamp is None else _angles(rig, key, lamp, half_px)
        if angles is not None:
            found[key.bracket] = angles
    if not found:
        return None
    nearest = min((near for near, _ in found.values()), key=lambda spot: (spot.phase_deg, spot.key))
    farthest = max((far for _, far in found.values()), key=lambda spot: (spot.phase_deg, spot.key))
    return nearest, farthest


def phase_angles(sandbox_from_camera: Pose, directions: np.ndarray, lamp_sandbox: np.ndarray) -> np.ndarray:
    """(...) phase angle in radians where directions (..., 3) of a camera meet the plane z = 0.

    NaN near the walls and outside them.
    """
    rays = sandbox_from_camera.rotate(directions)
    eye = sandbox_from_camera.translation
    with np.errstate(divide="ignore", invalid="ignore"):
        distance = np.where(rays[..., 2] < 0, -eye[2] / rays[..., 2], np.nan)
    ground = eye + distance[..., None] * rays
    inside = (np.abs(ground[..., :2]) <= SANDBOX_HALF_WIDTH - WALL_MARGIN).all(axis=-1)
    to_eye, to_lamp = eye - ground, lamp_sandbox - ground
    sine = np.linalg.norm(np.cross(to_eye, to_lamp), axis=-1)
    return np.where(inside, np.arctan2(sine, (to_eye * to_lamp).sum(axis=-1)), np.nan)


def _angles(rig: LocalisedRig, key: PhotoKey, lamp: np.ndarray, half_px: int) -> tuple[Spot, Spot] | None:
    lens = rig.rig.lens(key.camera)
    u = np.arange(half_px, lens.width - half_px, STEP_PX) + HALF_PIXEL
    v = np.arange(half_px, lens.height - half_px, STEP_PX) + HALF_PIXEL
    pixels = np.stack(np.meshgrid(u, v), axis=-1).reshape(-1, 2)
    angles = np.degrees(phase_angles(rig.sandbox_from(key.camera), lens.directions(pixels), lamp))
    if np.isnan(angles).all():
        return None
    near, far = (
        Spot(key, float(pixels[at, 0]), float(pixels[at, 1]), float(angles[at]))
        for at in (np.nanargmin(angles), np.nanargmax(angles))
    )
    return near, far


def draw_opposition(
    *,
    keys: Sequence[PhotoKey],
    cameras: Mapping[int, Path],
    photo_domain: str,
    models: Sequence[str],
    pictures: Iterable[Path],
    figure: Path,
    text: Path,
    width: int = FIGURE_WIDTH,
) -> None:
    """Write the figure, and in a JSON file what it shows or why it shows nothing.

    Rows: the smallest and the largest phase angle; columns: photo and twins. The crops of a row have one white, that of
    the brightest, so that brightness can be compared; below each stands its median.

    Parameters
    ----------
    keys
        Photos that may be shown; the terrain that comes nearest to opposition is.
    cameras
        Folder of each terrain's rig poses and lamps.
    pictures
        Tables of photos and folders of twins, see `picture_finder`.
    """
    domains, picture_of = [photo_domain, *models], picture_finder(photo_domain, pictures)
    pictured = [key for key in keys if all(_exists(picture_of(domain, key)) for domain in domains)]
    spots = _of_best_terrain(pictured, cameras)
    facts = _refused(spots)
    if spots is None or facts:
        with page(figure, width, 300) as sheet:
            note(sheet, facts)
        write_json(text, {"shown": False, "text": facts})
        return
    cell = width // len(domains)
    texts = []
    with page(figure, width, 2 * (cell + _ROW_PX)) as sheet:
        grid = sheet.subplots(2, len(domains), squeeze=False)
        for axes, spot in zip(grid, spots, strict=True):
            alike = [key for key in pictured if key.bracket == spot.key.bracket]
            crops_of = {key: [_crop(picture_of(domain, key), spot) for domain in domains] for key in alike}
            key = min(crops_of, key=lambda key: (_off_grey(crops_of[key]), key))
            crops = crops_of[key]
            _draw_row(axes, crops, domains, spot, key)
            texts.append(_words(crops, domains, spot, key))
    write_json(text, {"shown": True, "text": " ".join(texts).removesuffix(".")})


def _refused(spots: tuple[Spot, Spot] | None) -> str:
    """Why nothing can be shown; "" where something can."""
    if spots is None:
        return "No photo of this run with its twins is lit by a single lamp, so none has a phase angle to show"
    nearest = spots[0].phase_deg
    if nearest > NEAR_DEG:
        return (
            f"The smallest phase angle in this run is {nearest:.1f} degrees ({spots[0].key}), too far from opposition "
            f"to show its surge (less than {NEAR_DEG:g} degrees)"
        )
    return ""


def _exists(path: Path | None) -> bool:
    return path is not None and path.exists()


def _of_best_terrain(keys: Sequence[PhotoKey], cameras: Mapping[int, Path]) -> tuple[Spot, Spot] | None:
    """The spots of the terrain that comes nearest to opposition; of several alike the first one."""
    found = [
        extreme_spots([key for key in keys if key.terrain == terrain], folder, HALF_PX)
        for terrain, folder in sorted(cameras.items())
    ]
    return min((spots for spots in found if spots), key=lambda spots: round(spots[0].phase_deg, 1), default=None)


def _off_grey(crops: Sequence[np.ndarray]) -> tuple[int, float]:
    """How many crops tell no brightness, and how far the one that is exposed worst is from a middle grey, in stops."""
    unclear = sum(not _is_clear(_signal(crop)) for crop in crops)
    return unclear, max(abs(float(np.log2(max(_signal(crop), 1.0) / _WELL_EXPOSED_DN))) for crop in crops)


def _crop(path: Path | None, spot: Spot) -> np.ndarray:
    assert path is not None, "only pictures that are there are asked for"
    left, top = int(spot.u) - HALF_PX, int(spot.v) - HALF_PX
    return png.read(path)[top : top + 2 * HALF_PX, left : left + 2 * HALF_PX]


def _signal(crop: np.ndarray) -> float:
    """Median, DN above black."""
    return float(np.median(crop.astype(float)) - BLACK_LEVEL)


def _is_clear(signal: float) -> bool:
    """Whether a median, DN above black, is neither black nor clipped."""
    return 1 <= signal < WHITE_LEVEL - BLACK_LEVEL


def _draw_row(axes: Any, crops: list[np.ndarray], domains: Sequence[str], spot: Spot, key: PhotoKey) -> None:
    white = max(map(white_of, crops))
    for panel, domain, crop in zip(axes, domains, crops, strict=True):
        panel.imshow(to_8bit(crop, white), interpolation="antialiased")
        panel.set_xticks([])
        panel.set_yticks([])
        panel.set_title(paper.domain_title(domain))
        panel.set_xlabel(f"median {_signal(crop):.0f} DN")
    axes[0].set_ylabel(f"phase {spot.phase_deg:.1f}°\n{key}", fontsize="small")


def _words(crops: list[np.ndarray], domains: Sequence[str], spot: Spot, key: PhotoKey) -> str:
    """How bright the twins are beside the photo; nothing is said about crops that are clipped or dark."""
    photo = _signal(crops[0])
    start = f"At a phase angle of {spot.phase_deg:.1f} degrees ({key})"
    signals = {domain: _signal(crop) for domain, crop in zip(domains[1:], crops[1:], strict=True)}
    unclear = [domain for domain, signal in {domains[0]: photo, **signals}.items() if not _is_clear(signal)]
    if unclear:
        return f"{start} the median of {_listed(map(paper.domain_title, unclear))} is clipped or black: no comparison."
    ratios = _listed(f"{signal / photo:.2f} ({paper.domain_title(domain)})" for domain, signal in signals.items())
    return f"{start} the crop's median over that of {paper.domain_title(domains[0])} is {ratios}."


def _listed(text: Iterable[str]) -> str:
    """a; a and b; a, b and c."""
    *first, last = text
    return f"{', '.join(first)} and {last}" if first else last
