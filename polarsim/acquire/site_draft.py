"""Text of the draft of a site file, with comments for the person who completes it."""

from __future__ import annotations

import json
import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from polarsim.acquire.path_fields import PathFields, plain_name
from polarsim.errors import PolarsimError
from polarsim.formats.stated_calibration import StatedCalibration
from polarsim.photo import NO_SUN, parse_terrain, terrain_text
from polarsim.site_parts import FILL_IN

_BASELINE_TOLERANCE = 0.2  # share


@dataclass(frozen=True)
class ImageForm:
    """Format of the images: size, bits, black and white level (None: the largest value), and what was seen."""

    width: int
    height: int
    bits: int
    black: int
    white: int | None
    colour: bool
    jpeg: bool


@dataclass(frozen=True)
class Scans:
    """Patterns of clouds, range maps and calibrations, the unit of the clouds, and errors of skipped files."""

    clouds: str | None = None
    range_maps: str | None = None
    calibration: str | None = None
    unit: str = "m"
    stated: StatedCalibration | None = None
    skipped: tuple[PolarsimError, ...] = ()


def draft_text(name: str, folder: Path, fields: PathFields, form: ImageForm, scans: Scans) -> str:
    """Return the text of a site file; values that files do not show start with FILL_IN."""
    lines = [
        f"# Draft of a site for {folder}. Replace every value FILL_IN, then: polarsim check-site FILE --root FOLDER",
        "# All keys: docs/reference/configuration.md. Lengths are metres; +X and +Y are directions that you choose.",
        f"name: {plain_name(name, 'site')}",
        "",
        f"terrains: [{', '.join(_terrains(fields))}] # scenes",
        f"positions: [{', '.join(map(_quoted, _names(fields, 'position') or ['A']))}] # of the camera or rig",
        "# Approximate poses of the left (or only) camera, where known: yaw from +X towards +Y, pitch downwards.",
        "# tripods:",
        f"#   {(_names(fields, 'position') or ['A'])[0]}: {{camera_m: [x, y, z], yaw_deg: 180, pitch_deg: 25}}",
        *_lamps(fields),
        *_exposures(fields),
        "",
        *_images(form),
        *_cameras(fields, scans),
        "sandbox:",
        _marked("  half_width_m", "[half the size along X, along Y]"),
        "  walls_m: {} # height above the ground by side, for example {-x: 0.3, +x: 0.3, -y: 0.3, +y: 0.3}; {}: none",
        "",
        *_files(fields, scans),
    ]
    return "\n".join(lines) + "\n"


def _marked(key: str, text: str) -> str:
    return f"{key}: {json.dumps(f'{FILL_IN}: {text}')}"


def _text(text: str) -> str:
    return json.dumps(text, ensure_ascii=False)


def _quoted(name: str) -> str:
    return name if re.fullmatch(r"[A-Za-z][A-Za-z0-9-]*", name) and name.lower() not in _WORDS else f'"{name}"'


_WORDS = {"on", "off", "yes", "no", "y", "n", "true", "false", "null"}  # YAML reads them as other types


def _names(fields: PathFields, field: str) -> list[str]:
    return list(fields.names.get(field, {}))


def _terrains(fields: PathFields) -> Sequence[str]:
    names = _names(fields, "terrain") or ["site"]
    return [str(parse_terrain(name)) if name.isdecimal() else _quoted(name) for name in names]


def _lamps(fields: PathFields) -> list[str]:
    suns = [name for name in (_names(fields, "azimuth") or ["sun"]) if name != NO_SUN]
    lines = ["lamps: # a lamp at a place, or parallel light: {kind: directional, azimuth_deg: 45, elevation_deg: 8}"]
    lines += [_marked(f"  {_quoted(name)}", "{position_m: [x, y, z]}") for name in suns]
    if NO_SUN in _names(fields, "azimuth"):
        lines.append("without_lamp: true # photos without these lamps")
    if "light" in fields.names:
        place = json.dumps(f"{FILL_IN}: [x right, y down, z forward] of the left camera")
        share = json.dumps(f"{FILL_IN}: radiant intensity relative to another lamp, such as 0.05")
        lines.append(f"rig_lamp: {{from_camera_m: {place}, share: {share}}} # moves with the rig")
    return lines


def _exposures(fields: PathFields) -> list[str]:
    times = sorted({time for name, of in fields.exposures_ms.items() if name != NO_SUN for time in of})
    lines = [f"exposures_ms: {times}" if times else _marked("exposures_ms", "[exposures of the photos, ms]")]
    if dark := fields.exposures_ms.get(NO_SUN):
        lines.append(f"exposures_no_sun_ms: {dark}")
    elif NO_SUN in _names(fields, "azimuth"):
        lines.append(_marked("exposures_no_sun_ms", "[exposures of photos without a lamp, ms]"))
    return lines


def _images(form: ImageForm) -> list[str]:
    white = "" if form.white is None else f", white: {form.white}"
    curve = ", curve: srgb" if form.jpeg else ""
    seen = "in colour, converted to grey; " if form.colour else ""
    return [
        f"images: {{width: {form.width}, height: {form.height}, bits: {form.bits}, black: {form.black}{white}{curve}}}"
        f" # {seen}black: darkest values of a sample, check them"
    ]


def _cameras(fields: PathFields, scans: Scans) -> list[str]:
    lines = ["cameras:"]
    if "camera" not in fields.names:
        lines.append("  stereo: false")
    elif scans.stated is not None and scans.stated.translation is not None:
        length = float(np.linalg.norm(scans.stated.translation))
        low, high = ((1 + sign * _BASELINE_TOLERANCE) * length for sign in (-1, 1))
        lines.append(f"  baseline_m: [{low:.3g}, {high:.3g}] # {length:.4g} in the calibration")
    else:
        lines.append(_marked("  baseline_m", "[smallest, largest plausible distance of the cameras]"))
    if scans.calibration is None:
        lines.append(_marked("  calibration", "file of NASA's form, OpenCV YAML, Kalibr YAML or COLMAP cameras.txt"))
    return lines


def _files(fields: PathFields, scans: Scans) -> list[str]:
    lines = ["files: # below source.root"]
    if fields.are_stated:
        lines.append(f"  photos: {_text(fields.pattern)}")
    else:
        lines.append(_marked("  photos", "pattern with fields, such as {terrain}/{azimuth}/{exposure_ms}.png"))
    for key, pattern in (
        ("clouds", scans.clouds),
        ("range_maps", scans.range_maps),
        ("calibration", scans.calibration),
    ):
        if pattern:
            lines.append(f"  {key}: {_text(pattern)}")
    if scans.clouds:
        lines.append("  cloud_frame: left # of the left camera (x right, y down, z forward), or: rectified; check it")
        lines.append(f"  cloud_unit: {scans.unit}")
    spelled = {
        field: {name: text for name, text in names.items() if text != _default_text(field, name)}
        for field, names in fields.names.items()
    }
    if any(spelled.values()):
        lines.append("  spelling: # texts in paths")
        for field, names in spelled.items():
            if names:
                pairs = ", ".join(f"{_text(name)}: {_text(text)}" for name, text in names.items())
                lines.append(f"    {field}: {{{pairs}}}")
    return lines


def _default_text(field: str, name: str) -> str:
    return terrain_text(parse_terrain(name)) if field == "terrain" else name
