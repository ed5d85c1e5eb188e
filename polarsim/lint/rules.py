"""Rules of the linter: defects with code, severity, meaning and repair; other modules refer to them by name."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

from polarsim.errors import PolarsimError

Severity = Literal["error", "warning", "note"]
EVERYTHING = "ALL"


@dataclass(frozen=True)
class Rule:
    """Kind of defect."""

    code: str
    severity: Severity
    meaning: str
    repair: str = ""  # repair by `--fix`; empty if a person must decide


@dataclass(frozen=True)
class Defect:
    """Defect of a file."""

    name: str  # name of its rule
    detail: str = ""
    rows: tuple[int, ...] = ()  # indices of the file's boxes or polygons
    lacking: tuple[tuple[float, ...], ...] = ()  # missing boxes, pixels


_MODAL = "uses the content of most exposures of the exposure bracket"
_DROP = "omits the file"

RULES: dict[str, Rule] = {
    # Files
    "stray_name": Rule("F101", "warning", "file name is not part of the layout: a copy, a suffix", _DROP),
    "system_file": Rule("F102", "warning", "file of an operating system", _DROP),
    "impossible_exposure": Rule("F103", "warning", "exposure that no photo has", "uses the nearest valid exposure"),
    "wrong_folder": Rule("F104", "warning", "photo key in the folder of another terrain", _DROP),
    "missing_file": Rule("F105", "warning", "missing file in a nearly complete exposure bracket", _MODAL),
    "empty_file": Rule("F106", "warning", "no box, although other exposures have boxes", _MODAL),
    "missing_right": Rule("F107", "warning", "unlabelled right photo without Sun of a labelled left photo"),
    "missing_picture": Rule("F108", "warning", "labels without a picture (folders with images)"),
    "missing_labels": Rule("F109", "note", "picture without labels (folders with images)"),
    "malformed": Rule("F110", "error", "line is not a box or polygon of a known class", "omits the line"),
    # Boxes of one file
    "duplicate": Rule("B201", "warning", "repeated box", "keeps the first"),
    "near_duplicate": Rule("B202", "warning", "boxes of a class at the same place (IoU over 0.7)", "keeps the first"),
    "rock_on_shadow": Rule("B203", "warning", "rock and shadow at the same place (IoU over 0.7)"),
    "out_of_photo": Rule("B204", "error", "extends outside the photo", "clips it at the border"),
    "sliver": Rule("B205", "note", "side shorter than 6 px at photo width 1936"),
    "giant": Rule("B206", "warning", "over 60 % of a side or 20 % of the area of the photo"),
    # Exposures of one exposure bracket
    "rock_missing": Rule("E301", "warning", "rock of most exposures is missing", _MODAL),
    "rock_extra": Rule("E302", "warning", "rock that is not in most exposures", _MODAL),
    "rock_moved": Rule("E303", "warning", "rock differs from most exposures (IoU below 0.9)", _MODAL),
    "shadow_missing": Rule("E304", "warning", "shadows of most exposures are missing", _MODAL),
    "shadow_extra": Rule("E305", "warning", "shadow that is not in most exposures", _MODAL),
    "shadow_moved": Rule("E306", "warning", "shadow differs from most exposures", _MODAL),
    "shadows_off_late": Rule("E307", "warning", "no shadow, although a shorter exposure has shadows", _MODAL),
    "few_shadows": Rule("E308", "note", "at least 4 fewer shadows than rocks, but not zero"),
    "many_shadows": Rule("E309", "warning", "at least 3 more shadows than rocks"),
    # Other azimuths and lights of the view
    "copied_azimuth": Rule("S401", "warning", "same content as under another Sun lamp"),
    "rock_absent": Rule("S402", "note", "rock is missing that is annotated under all other Sun lamps"),
    "rock_alone": Rule("S403", "note", "rock that is annotated under no other Sun lamp"),
    "swapped_class": Rule("S404", "error", "shadow at a place where two other azimuths have a rock", "makes it a rock"),
    "light_rocks_differ": Rule("S405", "note", "number of rocks differs between rover light on and off"),
    "light_rock_moved": Rule("S406", "note", "rock differs between rover light on and off (IoU below 0.9)"),
    "light_shadows_differ": Rule("S407", "note", "number of shadows differs between rover light on and off"),
    "light_shadow_moved": Rule("S408", "note", "shadow differs between rover light on and off"),
    "other_azimuth": Rule("S409", "error", "shadows fit another Sun lamp better than the azimuth in the file's name"),
    # Geometry and light
    "other_view": Rule("V501", "error", "rocks fit another position or camera better than those in the file's name"),
    "off_epipolar": Rule("V502", "warning", "boxes of a rock in left and right violate the epipolar constraint"),
    "sunward_shadow": Rule("V503", "note", "shadow on the Sun's side of its rock"),
    # Polygons
    "invalid_ring": Rule("P601", "warning", "outline that intersects itself", "keeps its largest valid part"),
    "tiny_polygon": Rule("P602", "warning", "area below 9 px", "omits it"),
    "thin_polygon": Rule("P603", "warning", "extent below 2 px", "omits it"),
    "triangle": Rule("P604", "note", "only three points"),
    "ground_as_rock": Rule("P605", "error", "ground annotated as a rock", "makes it ground"),
    "no_ground": Rule("P606", "warning", "no ground"),
    "giant_shadow": Rule("P607", "warning", "shadow above 13 % of the photo"),
    "no_shadow_polygon": Rule("P608", "note", "rocks, but no shadow"),
    "cover_holes": Rule("P609", "warning", "over 2 % of the photo without a polygon"),
    "paint_order": Rule("P610", "note", "ground or background after a rock or shadow: painting in this order erases it",
                        "puts ground and background first"),
    "polygons_coincide": Rule("P611", "warning", "rock and shadow at the same place (IoU of boxes over 0.7)"),
    "other_camera_polygons": Rule("P612", "error", "rocks fit the boxes of the other camera better"),
    "rock_box_alone": Rule("P613", "note", "box of a rock without a polygon"),
    "shadow_box_alone": Rule("P614", "note", "box of a shadow without a polygon"),
    "rock_polygon_alone": Rule("P615", "note", "polygon of a rock without a box"),
    "shadow_polygon_alone": Rule("P616", "note", "polygon of a shadow without a box"),
    "class_mismatch": Rule("P617", "warning", "box of a shadow on the polygon of a rock"),
    # Meshes and pictures
    "unreadable_mesh": Rule("M701", "error", "invalid OBJ mesh"),
    "unreadable_picture": Rule("M702", "error", "invalid PNG"),
}  # fmt: skip


def select_rules(select: Sequence[str], ignore: Sequence[str]) -> set[str]:
    """Return the names of the rules in `select` (all if empty) that are not in `ignore`.

    Entries are names, codes or prefixes of codes, severities, or ALL.
    """
    wanted = _named(select) if select else set(RULES)
    return wanted - _named(ignore)


def _named(entries: Sequence[str]) -> set[str]:
    names: set[str] = set()
    for entry in entries:
        fitting = {
            name
            for name, rule in RULES.items()
            if entry in (name, EVERYTHING, rule.severity) or (entry and rule.code.startswith(entry))
        }
        if not fitting:
            raise PolarsimError(
                f"unknown rule {entry!r}: expected a name, a code such as B202, its prefix, or a severity"
            )
        names |= fitting
    return names
