"""Results page of a run, `results.html`; the template is `results_page.html.jinja`."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any
from urllib.parse import quote

import jinja2
import pandas as pd
from markdown_it import MarkdownIt
from markupsafe import Markup

from polarsim import __version__
from polarsim.formats import thumbnails
from polarsim.formats.files import read_json, relative_to, write_text
from polarsim.formats.tables import read_parquet
from polarsim.photo import Terrain, terrain_text
from polarsim.report import paper
from polarsim.report.headlines import headlines
from polarsim.report.layout import markdown
from polarsim.run_files.pictures import STRIP_TEXT
from polarsim.site import DEFAULT

_TEMPLATE = Path(__file__).with_name("results_page.html.jinja")
WIDE, PANEL, THUMBNAIL = 1100, 480, 320  # widths of figures in the text, panels of a strip and thumbnails, px
_FORMS = (".csv", ".parquet", ".md", ".tex")
_INTERVAL = re.compile(r"\[[^\[\]<>]*\]")
PARTS = ("train", "val", "test")


def write_results_page(
    *,
    tables: Mapping[str, Path],
    figures: Mapping[str, Path],
    strip: Path | None,
    phases: Sequence[Path],
    datasets: Mapping[tuple[str, str], Path],
    photos: Path | None,
    origin: Mapping[str, str],
    site: str,
    terrains: Sequence[Terrain],
    positions: Sequence[str],
    models: Sequence[str],
    photo_domain: str,
    others: Mapping[str, str],
    page: Path,
) -> None:
    """Write the results page: description of the run, headline metrics, images, all tables and figures.

    The page embeds small images that link to the full files. `tables` are Markdown files and `figures` PNG files by
    name (of one detector: `seen_<domain>`, `gap_rocks_<domain>`); the template skips missing ones. `phases` is the
    caption of the figure of the opposition effect, empty for a run without photos, `datasets` has the data set of each
    split and domain, and `others` maps the file names of further pages to titles. `site` is the name of the site.
    """
    environment = jinja2.Environment(autoescape=True, undefined=jinja2.StrictUndefined)
    source = origin["source"]
    content = _PageContent(tables, figures, source, page.parent)
    count = 0 if photos is None else len(read_parquet(photos, ["key"]))
    facts = {
        **({} if site == DEFAULT else {"site": site}),
        "terrains": f"{', '.join(map(terrain_text, terrains))} (positions {', '.join(positions)})",
        "photos": f"{count:,}" if count else "none",
        "twins": ", ".join(models),
        "detectors": ", ".join(dict.fromkeys(domain for _, domain in datasets)) or "none",
        "polarsim": __version__,
    }
    text = environment.from_string(_TEMPLATE.read_text(encoding="utf-8")).render(
        origin=origin,
        site=site,
        facts=facts,
        headlines=headlines({name: path.with_suffix(".csv") for name, path in tables.items()}, photo_domain, source),
        strip=content.strip(strip) if strip else None,
        others=others,
        pictures=_html(markdown(picture_counts(datasets, source), "Number of images per domain.")),
        comparison=next((name for name in figures if name.startswith("comparison_")), ""),
        opposition="".join(map(_opposition, phases)),
        has=tables.__contains__,
        table=content.table,
        figure=content.figure,
        figures=content.figures_of_detectors,
        all_tables=content.all_tables(),
        all_figures=content.all_figures(),
    )
    write_text(page, text)


def picture_counts(datasets: Mapping[tuple[str, str], Path], source: str) -> pd.DataFrame:
    """Return the numbers of training, validation and test images, a row per split and domain."""
    rows = []
    for (split, domain), folder in datasets.items():
        pictures = read_json(folder / "dataset.json")["pictures"]
        counts = {f"{part} images": int(pictures[part]) for part in PARTS}
        rows.append({"split by": split, "domain": paper.domain_title(paper.display_name(domain, source)), **counts})
    return pd.DataFrame(rows)


class _PageContent:
    """HTML of tables and figures for the template; missing tables and figures give empty text."""

    def __init__(self, tables: Mapping[str, Path], figures: Mapping[str, Path], source: str, folder: Path) -> None:
        self._tables, self._figures, self._source, self._folder = tables, figures, source, folder

    def table(self, name: str) -> Markup:
        return _html(self._tables[name].read_text(encoding="utf-8")) if name in self._tables else Markup()

    def figure(self, name: str, caption: str) -> Markup:
        if name not in self._figures:
            return Markup()
        form = Markup('<figure id="{}"><a href="{}"><img alt="{}" src="{}"></a><figcaption>{}</figcaption></figure>')
        path = self._figures[name]
        return form.format(name, self._link(path), name.replace("_", " "), thumbnails.of_picture(path, WIDE), caption)

    def figures_of_detectors(self, name: str, caption: str) -> Markup:
        """Return the figures of all detectors; `{}` in the caption is replaced by the training domain."""
        domains = paper.sorted_domains(
            {key.removeprefix(f"{name}_") for key in self._figures if key.startswith(f"{name}_")}
        )
        titled = [(domain, paper.domain_title(paper.display_name(domain, self._source))) for domain in domains]
        return Markup("\n").join(self.figure(f"{name}_{domain}", caption.format(title)) for domain, title in titled)

    def strip(self, folder: Path) -> dict[str, Any]:
        """Return the photo key of a strip and the panels (link, thumbnail, name, caption)."""
        strip = read_json(folder / STRIP_TEXT)
        panels = [
            (self._link(path), thumbnails.of_picture(path, PANEL), name, caption)
            for name, caption in strip["panels"]
            if (path := folder / f"{name}.png")
        ]
        return {"key": strip["key"], "panels": panels}

    def all_tables(self) -> list[dict[str, Any]]:
        """Return name, links by file format, and HTML of every table."""
        rows = []
        for name, path in self._tables.items():
            files = [file for file in (path.with_suffix(suffix) for suffix in _FORMS) if file.exists()]
            links = {file.suffix[1:]: self._link(file) for file in files}
            rows.append({"name": name, "links": links, "html": self.table(name)})
        return rows

    def all_figures(self) -> dict[str, list[tuple[str, str, str]]]:
        """Return link, thumbnail and title of every figure, grouped by the part of the name before `_Terrain`."""
        groups: dict[str, list[tuple[str, str, str]]] = {}
        for name, path in self._figures.items():
            kind, of_terrain, where = name.partition("_Terrain")
            title = f"Terrain {where.replace('_Pos', ', position ')}" if of_terrain else name.replace("_", " ")
            group = kind.replace("_", " ") if of_terrain else "entire run"
            groups.setdefault(group, []).append((self._link(path), thumbnails.of_picture(path, THUMBNAIL), title))
        return groups

    def _link(self, path: Path) -> str:
        return quote(relative_to(path, self._folder))


def _html(text: str) -> Markup:
    """Convert Markdown (tables, captions, notes) to HTML; raw HTML is escaped.

    Cells may break before an interval but not inside, so that wide tables fit the page.
    """
    shown = MarkdownIt("commonmark", {"html": False}).enable("table").render(text)
    shown = _INTERVAL.sub(lambda found: found[0].replace(" ", "\N{NO-BREAK SPACE}"), shown)
    return Markup(f'<div class="table">{shown}</div>')  # noqa: S704  the parser escapes raw HTML


def _opposition(phases: Path) -> str:
    """Return the caption of the figure of the opposition effect; empty if no photo shows the effect."""
    content = read_json(phases)
    return f"{content['text']}." if content["shown"] else ""
