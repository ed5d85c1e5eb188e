"""Errata of a published set as a page: each defect drawn over the twin of its photo, if available."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from html import escape
from pathlib import Path

import numpy as np

from polarsim.errors import FormatError
from polarsim.formats import release, tables, thumbnails, yolo
from polarsim.formats.files import write_text
from polarsim.lint.files import Size
from polarsim.lint.findings import Finding, Report
from polarsim.lint.folders import lint_release
from polarsim.lint.rules import RULES, select_rules
from polarsim.photo import BOX_CLASSES, POLYGON_CLASSES
from polarsim.site import Site

FIGURE_WIDTH_PX = 484  # of a figure on the page
_SHOWN = 3  # maximum number of files named in a caption
_STYLE = """
body { font: 15px/1.45 system-ui, sans-serif; margin: 2rem auto; max-width: 1560px; padding: 0 1rem; color: #222; }
section { display: grid; grid-template-columns: repeat(auto-fill, minmax(484px, 1fr)); gap: 1.2rem; }
h1, h2, nav, p.about { margin: 1.2rem 0 0.4rem; } h2 span { color: #777; font-weight: normal; }
figure { margin: 0; } figcaption { font-size: 13px; overflow-wrap: anywhere; } svg { background: #f4f3f0; width: 100%; }
table { border-collapse: collapse; } td, th { padding: 0.15rem 0.8rem 0.15rem 0; text-align: left; }
.rock { stroke: #b8552b; } .shadow { stroke: #35618f; } .ground { stroke: #8a8a62; } .background { stroke: #bbb; }
.shape { fill: none; stroke-width: 4; } .wrong { fill: #f2c14e88; stroke-width: 9; }
.lacking { fill: none; stroke: #222; stroke-width: 7; stroke-dasharray: 22 14; }
"""


def lint_and_draw(*, site: Site, root: Path, twins: Sequence[Path], page: Path, table: Path, workers: int) -> None:
    """Validate a folder in the published layout; write all findings as a table, errors and warnings as a page.

    `twins` are folders with twins, KEY.png; defects of photos without a twin are drawn on a plain background.
    """
    report = lint_release(root, workers, site=site)
    tables.write_csv(table, report.table("code", "severity", "defect", "file", "line", "detail"))
    pictures = {path.stem: path for folder in twins for path in folder.glob("*.png")}
    write_errata(report.chosen(select_rules(("error", "warning"), ())), root, pictures, page, site.images.size)


def write_errata(report: Report, root: Path, twins: Mapping[str, Path], page: Path, size: Size) -> None:
    """Write a page with the findings in a folder of the published layout, by rule; equal files share a figure.

    `size` is the width and height of the photos, px.
    """
    counts = report.counts
    order = sorted(counts, key=lambda name: RULES[name].code)
    rows = "".join(
        f'<tr><td><a href="#{name}">{RULES[name].code}</a></td><td>{name}</td><td>{RULES[name].severity}</td>'
        f"<td>{counts[name]}</td><td>{escape(RULES[name].meaning)}</td></tr>"
        for name in order
    )
    files = len({finding.file for finding in report.findings})
    parts = [
        '<!doctype html><html lang="en"><meta charset="utf-8"><title>Errata</title>',
        f"<style>{_STYLE}</style><h1>Errata of the labels</h1>",
        f'<p class="about">{len(report.findings)} findings in {files} files. '
        "Rocks are red, shadows blue. Boxes and polygons of a finding are filled yellow, missing ones dashed. The "
        "background is the twin of the photo, if this run rendered it, from the published meshes and with cameras "
        "localised by the labels. "
        "Files with the same content share a figure.",
        f"<table><tr><th>code<th>rule<th>severity<th>files<th>meaning</tr>{rows}</table>",
    ]
    for name in order:
        parts.append(
            f'<h2 id="{name}">{RULES[name].code} {name} <span>{escape(RULES[name].meaning)}</span></h2><section>'
        )
        parts += _figures((finding for finding in report.findings if finding.defect == name), root, twins, size)
        parts.append("</section>")
    write_text(page, "\n".join([*parts, "</html>\n"]))


def _figures(findings: Iterable[Finding], root: Path, twins: Mapping[str, Path], size: Size) -> Iterator[str]:
    groups: dict[tuple[object, ...], list[Finding]] = {}
    for finding in findings:
        path = root / finding.file
        groups.setdefault((path.parent, _content(path), finding.rows, finding.detail), []).append(finding)
    for group in groups.values():
        files = [finding.file for finding in group]
        more = f" and {len(files) - _SHOWN} more" if len(files) > _SHOWN else ""
        text = f"{', '.join(files[:_SHOWN])}{more}" + (f": {group[0].detail}" if group[0].detail else "")
        picture = _picture(root / files[0], group[0], twins, size)
        yield f"<figure>{picture}<figcaption>{escape(text)}</figcaption></figure>"


def _content(path: Path) -> object:
    """Return a key of files that share a figure: the bytes of label files, else the suffix."""
    return path.read_bytes() if path.suffix == ".txt" and path.is_file() else path.suffix


def _picture(path: Path, finding: Finding, twins: Mapping[str, Path], size: Size) -> str:
    """Return the boxes or polygons of a file as SVG, wrong ones on top; empty without shapes."""
    wrong = set(finding.rows)
    try:
        shapes = list(_shapes(path, size))
    except (FormatError, IndexError):
        return ""
    if not shapes and not finding.lacking:
        return ""
    order = sorted(range(len(shapes)), key=lambda row: row in wrong)
    polygons = "".join(
        f'<polygon class="{shapes[row][0]} {"wrong" if row in wrong else "shape"}" points="{_points(shapes[row][1])}"/>'
        for row in order
    )
    polygons += "".join(f'<polygon class="lacking" points="{_points(_corners(*box))}"/>' for box in finding.lacking)
    background, (width, height) = "", size
    if path.stem in twins:  # twin of the photo
        uri = thumbnails.of_photo(twins[path.stem], FIGURE_WIDTH_PX)
        background = f'<image href="{uri}" width="{width}" height="{height}"/>'
    return f'<svg viewBox="0 0 {width} {height}" width="{FIGURE_WIDTH_PX}" role="img">{background}{polygons}</svg>'


def _shapes(path: Path, size: Size) -> Iterator[tuple[str, np.ndarray]]:
    """Yield class name and corners (n, 2) of each row of a label file."""
    if path.suffix != ".txt" or not path.is_file():
        return
    if release.POLYGONS in path.parts:
        for kind, vertices in yolo.read_polygons(path, size):
            yield POLYGON_CLASSES[kind], vertices
    else:
        for kind, box in zip(*yolo.read_boxes(path, size), strict=True):
            yield BOX_CLASSES[kind], _corners(*box)


def _corners(x0: float, y0: float, x1: float, y1: float) -> np.ndarray:
    return np.array([[x0, y0], [x1, y0], [x1, y1], [x0, y1]])


def _points(vertices: np.ndarray) -> str:
    return " ".join(f"{x:.0f},{y:.0f}" for x, y in vertices)
