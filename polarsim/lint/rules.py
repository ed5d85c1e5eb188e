"""The defects that the linter knows, each with its code; a defect is found by name everywhere else."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

from polarsim.errors import PolarsimError

Severity = Literal["error", "warning", "note"]
EVERYTHING = "ALL"


@dataclass(frozen=True)
class Rule:
    """One kind of defect."""

    code: str
    severity: Severity
    meaning: str
    repair: str = ""  # what `--fix` does about it; nothing where a person must look


@dataclass(frozen=True)
class Defect:
    """A defect of one file."""

    name: str  # of its rule
    detail: str = ""
    rows: tuple[int, ...] = ()  # of the file's boxes or polygons, from 0
    lacking: tuple[tuple[float, ...], ...] = ()  # boxes that ought to be there, pixels


_MODAL = "takes what most exposures of the exposure bracket show"
_DROP = "leaves the file out"

RULES: dict[str, Rule] = {
    # Files
    "stray_name": Rule("F101", "warning", "a name that the layout does not have: a copy, a suffix", _DROP),
    "system_file": Rule("F102", "warning", "a file that an operating system left", _DROP),
    "impossible_exposure": Rule("F103", "warning", "an exposure that no photo has", "names it as the next one"),
    "wrong_folder": Rule("F104", "warning", "a photo key in another terrain's folder", _DROP),
    "missing_file": Rule("F105", "warning", "a gap in a nearly complete exposure bracket", _MODAL),
    "empty_file": Rule("F106", "warning", "no box, though other exposures have some", _MODAL),
    "missing_right": Rule("F107", "warning", "a photo without Sun whose Left is labelled and whose Right is not"),
    "missing_picture": Rule("F108", "warning", "labels without a picture (folders with images)"),
    "missing_labels": Rule("F109", "note", "a picture without labels (folders with images)"),
    "malformed": Rule("F110", "error", "a line that is no box or polygon of a known class", "leaves the line out"),
    # Boxes of one file
    "duplicate": Rule("B201", "warning", "a box twice", "keeps the first"),
    "near_duplicate": Rule("B202", "warning", "two boxes of a class on one spot (IoU over 0.7)", "keeps the first"),
    "rock_on_shadow": Rule("B203", "warning", "a rock and a shadow on one spot (IoU over 0.7)"),
    "out_of_photo": Rule("B204", "error", "beyond the photo's border", "cuts it at the border"),
    "sliver": Rule("B205", "note", "a side below 6 px"),
    "giant": Rule("B206", "warning", "over 60 % of a side or 20 % of the area of the photo"),
    # Exposures of one exposure bracket
    "rock_missing": Rule("E301", "warning", "a rock that most exposures show is not there", _MODAL),
    "rock_extra": Rule("E302", "warning", "a rock that most exposures do not show", _MODAL),
    "rock_moved": Rule("E303", "warning", "a rock lies elsewhere than in most exposures (IoU below 0.9)", _MODAL),
    "shadow_missing": Rule("E304", "warning", "some shadows of most exposures are not there", _MODAL),
    "shadow_extra": Rule("E305", "warning", "a shadow that most exposures do not show", _MODAL),
    "shadow_moved": Rule("E306", "warning", "a shadow lies elsewhere than in most exposures", _MODAL),
    "shadows_off_late": Rule("E307", "warning", "no shadow, though a shorter exposure has some", _MODAL),
    "few_shadows": Rule("E308", "note", "some shadows, but at least 4 fewer than rocks"),
    "many_shadows": Rule("E309", "warning", "at least 3 more shadows than rocks"),
    # Other azimuths and lights of the view
    "copied_azimuth": Rule("S401", "warning", "the same content as under another Sun lamp"),
    "rock_absent": Rule("S402", "note", "a rock that was annotated under all other Sun lamps"),
    "rock_alone": Rule("S403", "note", "a rock that was annotated under no other Sun lamp"),
    "swapped_class": Rule("S404", "error", "a shadow where two other azimuths have a rock", "makes it a rock"),
    "light_rocks_differ": Rule("S405", "note", "other rocks with the rover light on than off"),
    "light_rock_moved": Rule("S406", "note", "a rock lies elsewhere with the rover light on (IoU below 0.9)"),
    "light_shadows_differ": Rule("S407", "note", "other shadows with the rover light on than off"),
    "light_shadow_moved": Rule("S408", "note", "a shadow lies elsewhere with the rover light on"),
    "other_azimuth": Rule("S409", "error", "the shadows fit another Sun lamp better than the file's own"),
    # Geometry and light
    "other_view": Rule("V501", "error", "the rocks fit another position or camera better than the file's own"),
    "off_epipolar": Rule("V502", "warning", "a rock's boxes in Left and Right lie on no common line"),
    "sunward_shadow": Rule("V503", "note", "a shadow on the Sun's side of its rock"),
    # Polygons
    "invalid_ring": Rule("P601", "warning", "an outline that crosses itself", "keeps its largest valid part"),
    "tiny_polygon": Rule("P602", "warning", "an area below 9 px", "leaves it out"),
    "thin_polygon": Rule("P603", "warning", "an extent below 2 px", "leaves it out"),
    "triangle": Rule("P604", "note", "three points only"),
    "ground_as_rock": Rule("P605", "error", "the ground annotated as a rock", "makes it ground"),
    "no_ground": Rule("P606", "warning", "no ground"),
    "giant_shadow": Rule("P607", "warning", "a shadow above 300,000 px"),
    "no_shadow_polygon": Rule("P608", "note", "rocks, but no shadow"),
    "cover_holes": Rule("P609", "warning", "over 2 % of the photo under no polygon"),
    "paint_order": Rule("P610", "note", "ground or background after a rock or shadow: painting in this order erases it",
                        "puts ground and background first"),
    "polygons_coincide": Rule("P611", "warning", "a rock and a shadow on one spot (IoU of boxes over 0.7)"),
    "other_camera_polygons": Rule("P612", "error", "the rocks fit the boxes of the other camera better"),
    "rock_box_alone": Rule("P613", "note", "a rock's box without a polygon"),
    "shadow_box_alone": Rule("P614", "note", "a shadow's box without a polygon"),
    "rock_polygon_alone": Rule("P615", "note", "a rock's polygon without a box"),
    "shadow_polygon_alone": Rule("P616", "note", "a shadow's polygon without a box"),
    "class_mismatch": Rule("P617", "warning", "a shadow's box on a rock's polygon"),
    # Meshes and pictures
    "unreadable_mesh": Rule("M701", "error", "no OBJ mesh"),
    "unreadable_picture": Rule("M702", "error", "no PNG"),
}  # fmt: skip


def chosen(select: Sequence[str], ignore: Sequence[str]) -> set[str]:
    """Names of the rules that `select` (all where empty) and `ignore` leave.

    Entries are names, codes or their beginnings, severities, or ALL.

    Raises
    ------
    PolarsimError
        An entry that fits no rule.
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
            raise PolarsimError(f"{entry!r} is no rule: a name, a code such as B202, its beginning, or a severity")
        names |= fitting
    return names
