"""Draft of a site file from the files in a folder: names, sizes, bits, exposures, cameras, calibrations and scans."""

from __future__ import annotations

import re
import shlex
from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from polarsim.acquire.path_fields import PathFields, find_fields, largest_group
from polarsim.acquire.site_draft import ImageForm, Scans, draft_text
from polarsim.acquire.value_range import bits_of, saturated_value
from polarsim.errors import FormatError, PolarsimError
from polarsim.formats import nasa, png
from polarsim.formats.calibrations import read_stated
from polarsim.formats.clouds import CLOUD_SUFFIXES, read_cloud
from polarsim.formats.files import existing_folder, suffix_counts, write_text
from polarsim.site_file_names import FIELD
from polarsim.wording import counted

_MAX_SAMPLES = 24  # number of images of which pixels are read
_DARK_SHARE, _BLACK_SHARE = 0.05, 0.25  # of the largest value: median of a photo without light, and black level
_CALIBRATION = re.compile(r"(?i).*\.(calibration|ya?ml)|(.*/)?cameras\.txt")
_FAR = 100.0  # median distance of a cloud above which the unit is millimetres
_RANGE_SUFFIXES = (".tif", ".tiff")
_OF_SCAN = ("terrain", "position")  # fields in the names of scans
_MAX_FORMS = 4  # number of different sizes or depths of images that are listed
_MAX_DAMAGED = 3  # number of files of a pattern that are tried
_MAX_REASONS = 5  # number of skipped files whose reasons are listed


def write_draft(folder: Path, out: Path) -> list[str]:
    """Write the draft of a site file for a folder; return lines on what was found."""
    files = sorted(
        path for path in existing_folder(folder).rglob("*") if path.is_file() and not path.name.startswith(".")
    )
    names = [path.relative_to(folder).as_posix() for path in files]
    all_images = [name for name in names if name.lower().endswith(png.SUFFIXES)]
    images = largest_group(all_images)
    if not images:
        raise FormatError(f"no images, found {suffix_counts(folder)}", path=folder)
    used = set(images)
    fields = find_fields(images)
    form = image_form(folder, images)
    scans = find_scans(folder, [name for name in names if name not in used], fields, form)
    write_text(out, draft_text(out.stem, folder, fields, form, scans))
    unnamed = [name for name in names if _is_cloud(name) and not _replaced(name, fields, _OF_SCAN)]
    return [
        f"{len(images)} images of {form.width} x {form.height} pixels with {form.bits} bits: {fields.pattern}",
        *(f"{field}: {', '.join(list(of)[:8])}{' ...' if len(of) > 8 else ''}" for field, of in fields.names.items()),
        *(f"{kind}: {text}" for kind, text in (("clouds", scans.clouds), ("range maps", scans.range_maps)) if text),
        f"calibration: {scans.calibration or 'none found'}",
        *_skipped(scans.skipped),
        *_unused([name for name in all_images if name not in used]),
        *_unnamed(unnamed),
        *fields.notes,
        f"{out}: replace FILL_IN, then: {shlex.join(['polarsim', 'check-site', str(out), '--root', str(folder)])}",
    ]


def _unused(images: Sequence[str]) -> list[str]:
    """Return a line on images with another suffix or in another number of folders, such as range maps."""
    return [f"images without this pattern: {len(images)}, such as {images[0]}"] if images else []


def _unnamed(clouds: Sequence[str]) -> list[str]:
    """Return a line on clouds whose names do not contain the texts of terrain and position in the photos."""
    return [f"clouds without terrain and position in their names: {len(clouds)}, such as {clouds[0]}"] if clouds else []


def _is_cloud(name: str) -> bool:
    """Return whether a file is a cloud by its suffix; texts may have any content."""
    return name.lower().endswith(CLOUD_SUFFIXES) and not name.lower().endswith(".txt")


def _skipped(errors: Sequence[PolarsimError]) -> list[str]:
    """Return a line for each scan and calibration that could not be read, up to a maximum number."""
    rest = len(errors) - _MAX_REASONS
    lines = [f"skipped: {error}" for error in errors[:_MAX_REASONS]]
    return [*lines, f"skipped: {rest} more scans and calibrations"] if rest > 0 else lines


def image_form(folder: Path, names: Sequence[str]) -> ImageForm:
    """Return the format of images, from a sample; images of several sizes or depths are an error."""
    step = max(1, len(names) // _MAX_SAMPLES)
    sample = {name: png.read_png(folder / name) for name in names[::step]}
    _require_equal(folder, {name: f"{pixels.shape[1]} x {pixels.shape[0]} pixels" for name, pixels in sample.items()})
    _require_equal(folder, {name: f"{8 * pixels.itemsize} bits" for name, pixels in sample.items()})
    first = next(iter(sample.values()))
    largest = max(int(pixels.max()) for pixels in sample.values())
    bits, white = bits_of(list(sample.values())), saturated_value(list(sample.values()))
    medians = [int(np.median(pixels)) for pixels in sample.values()]
    # A photo without light shows the black level; in other photos the darkest pixels are in shadows.
    shadows = min(int(np.percentile(pixels, 1)) for pixels in sample.values())
    darkest = min(medians) if min(medians) < _DARK_SHARE * largest else shadows
    return ImageForm(
        width=first.shape[1],
        height=first.shape[0],
        bits=bits,
        black=darkest if darkest < _BLACK_SHARE * largest else 0,
        white=None if white == 2**bits - 1 else white,
        colour=any(pixels.ndim == 3 for pixels in sample.values()),
        jpeg=names[0].lower().endswith((".jpg", ".jpeg")),
    )


def _require_equal(folder: Path, forms: Mapping[str, str]) -> None:
    """Raise a `FormatError` with names of files if the images of a sample have several forms, by name."""
    names_of: dict[str, list[str]] = {}
    for name, form in forms.items():
        names_of.setdefault(form, []).append(name)
    if len(names_of) > 1:
        common = sorted(names_of.items(), key=lambda item: -len(item[1]))[:_MAX_FORMS]
        listed = ", ".join(f"{form} ({counted(len(names), 'image')}, such as {names[0]})" for form, names in common)
        raise FormatError(
            f"{counted(len(forms), 'examined image')} of {len(names_of)} forms: {listed}; move images of other forms "
            "to another folder, or convert all to the same form",
            path=folder,
        )


def find_scans(folder: Path, names: Sequence[str], fields: PathFields, form: ImageForm) -> Scans:
    """Return the patterns of scans and calibrations among the files that are no photos, and errors of skipped files."""
    scans, size, skipped = Scans(), (form.width, form.height), list[PolarsimError]()
    clouds = [name for name in names if name.lower().endswith(CLOUD_SUFFIXES)]
    if found := _readable(clouds, fields, lambda name: read_cloud(folder / name, "m"), skipped):
        pattern, cloud = found
        far = float(np.median(np.linalg.norm(cloud, axis=1))) > _FAR
        scans = replace(scans, clouds=pattern, unit="mm" if far else "m")
    maps = [name for name in names if name.lower().endswith(_RANGE_SUFFIXES)]
    if found := _readable(maps, fields, lambda name: nasa.read_range_map(folder / name, size), skipped):
        scans = replace(scans, range_maps=found[0])
    stated = {}
    for name in filter(_CALIBRATION.fullmatch, names):
        try:
            stated[name] = read_stated(folder / name)
        except PolarsimError as error:
            skipped.append(error)
    if stated:
        pattern = _pattern(stated, fields) or min(stated, key=lambda name: (name.count("/"), name))
        scans = replace(scans, calibration=pattern, stated=next(iter(stated.values())))
    return replace(scans, skipped=tuple(skipped))


def _readable(
    names: Sequence[str], fields: PathFields, read: Callable[[str], np.ndarray], skipped: list[PolarsimError]
) -> tuple[str, np.ndarray] | None:
    """Return the pattern of most files of which a file can be read, and the content of that file.

    Errors of files that cannot be read are appended to `skipped`.
    """
    patterns: dict[str, list[str]] = {}
    for name in names:
        if pattern := _replaced(name, fields, _OF_SCAN):
            patterns.setdefault(pattern, []).append(name)
    for pattern, files in sorted(patterns.items(), key=lambda item: -len(item[1])):
        for name in files[:_MAX_DAMAGED]:
            try:
                return pattern, read(name)
            except PolarsimError as error:
                skipped.append(error)
    return None


def _pattern(names: Iterable[str], fields: PathFields) -> str | None:
    """Return the pattern that most names have when the text of the terrain is replaced by the field."""
    patterns = Counter(pattern for name in names if (pattern := _replaced(name, fields, ("terrain",))))
    return patterns.most_common(1)[0][0] if patterns else None


def _replaced(name: str, fields: PathFields, chosen: Sequence[str]) -> str | None:
    """Return a path with fields for the texts of names; None if a text is missing.

    Folders that also contain photos are written as in the pattern of the photos.
    """
    needed = [field for field in chosen if field in fields.names]
    folders = name.split("/")
    for number, part in enumerate(fields.pattern.split("/")[:-1][: len(folders) - 1]):
        if set(FIELD.findall(part)) <= {*chosen, "any"} and re.fullmatch(_regex(part, fields), folders[number]):
            folders[number] = part
    name = "/".join(folders)
    for field in needed:
        if f"{{{field}}}" in name:
            continue
        texts = "|".join(map(re.escape, sorted(fields.names[field].values(), key=len, reverse=True)))
        match = re.search(rf"(?<![A-Za-z0-9{{])[A-Za-z]*?({texts})(?![A-Za-z0-9}}])", name)
        if match is None:
            return None
        name = f"{name[: match.start(1)]}{{{field}}}{name[match.end(1) :]}"
    return name


def _regex(part: str, fields: PathFields) -> str:
    """Return a regular expression of a folder of the pattern."""
    texts = {name: "|".join(map(re.escape, of.values())) for name, of in fields.names.items()}
    pieces = re.split(FIELD.pattern, part)  # texts and names of fields by turns
    return "".join(
        f"(?:{texts.get(piece, '.+')})" if number % 2 else re.escape(piece) for number, piece in enumerate(pieces)
    )
