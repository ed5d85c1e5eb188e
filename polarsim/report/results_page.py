"""One page of what a run's detectors found: its tables and figures, laid out by `results_page.html.jinja`."""

from __future__ import annotations

import base64
import io
from collections.abc import Mapping, Sequence
from pathlib import Path

import jinja2
import pandas as pd
from markdown_it import MarkdownIt
from markupsafe import Markup

from polarsim.formats.files import read_json, write_text
from polarsim.report import paper
from polarsim.report.layout import markdown

_TEMPLATE = Path(__file__).with_name("results_page.html.jinja")
_QUALITY = 88  # of JPEGs: lines and digits stay sharp
PARTS = ("train", "val", "test")


def write_results_page(
    *,
    tables: Mapping[str, Path],
    figures: Mapping[str, Path],
    phases: Sequence[Path],
    datasets: Mapping[tuple[str, str], Path],
    page: Path,
    origin: Mapping[str, str],
) -> None:
    """Write `page`, HTML that needs no other file.

    Parameters
    ----------
    tables
        Markdown form of the run's tables by name; the template leaves out what a run has not.
    figures
        PNG by name; those of one detector as `seen_<domain>` and `gap_rocks_<domain>`.
    phases
        What the figure of the opposition effect shows, `figures/opposition.json`; none where there are no photos.
    datasets
        Data set of each split and domain.

    Raises
    ------
    FormatError
        A file is missing or broken.
    """
    environment = jinja2.Environment(autoescape=True, undefined=jinja2.StrictUndefined)
    run = _Run(tables, figures, origin["source"])
    text = environment.from_string(_TEMPLATE.read_text(encoding="utf-8")).render(
        origin=origin,
        pictures=_html(markdown(picture_counts(datasets, origin["source"]), "Pictures of every domain.")),
        comparison=next((name for name in figures if name.startswith("comparison_")), ""),
        opposition="".join(map(_opposition, phases)),
        has=tables.__contains__,
        table=run.table,
        figure=run.figure,
        figures=run.figures_of_detectors,
    )
    write_text(page, text)


def picture_counts(datasets: Mapping[tuple[str, str], Path], source: str) -> pd.DataFrame:
    """A row a split and domain: pictures that train, choose the weights and test."""
    rows = []
    for (split, domain), folder in datasets.items():
        pictures = read_json(folder / "dataset.json")["pictures"]
        counts = {f"{part} pictures": int(pictures[part]) for part in PARTS}
        rows.append({"split by": split, "domain": paper.title(paper.own_name(domain, source)), **counts})
    return pd.DataFrame(rows)


class _Run:
    """Tables and figures as the template asks for them; what a run has not is nothing."""

    def __init__(self, tables: Mapping[str, Path], figures: Mapping[str, Path], source: str) -> None:
        self._tables, self._figures, self._source = tables, figures, source

    def table(self, name: str) -> Markup:
        return _html(self._tables[name].read_text(encoding="utf-8")) if name in self._tables else Markup()

    def figure(self, name: str, caption: str) -> Markup:
        if name not in self._figures:
            return Markup()
        form = Markup('<figure id="{}"><img alt="{}" src="{}"><figcaption>{}</figcaption></figure>')
        return form.format(name, name.replace("_", " "), _embedded(self._figures[name]), caption)

    def figures_of_detectors(self, name: str, caption: str) -> Markup:
        """Each detector's own; `{}` in the caption becomes the domain that it was trained on."""
        domains = paper.in_order({key.removeprefix(f"{name}_") for key in self._figures if key.startswith(f"{name}_")})
        titled = [(domain, paper.title(paper.own_name(domain, self._source))) for domain in domains]
        return Markup("\n").join(self.figure(f"{name}_{domain}", caption.format(title)) for domain, title in titled)


def _html(text: str) -> Markup:
    """Markdown of ours as HTML: tables, captions, notes; raw HTML in it is shown as text."""
    shown = MarkdownIt("commonmark", {"html": False}).enable("table").render(text)
    return Markup(f'<div class="table">{shown}</div>')  # noqa: S704  the parser has escaped all that is no markup


def _opposition(phases: Path) -> str:
    """What the figure shows; empty where no photo shows the effect."""
    content = read_json(phases)
    return f"{content['text']}." if content["shown"] else ""


def _embedded(path: Path) -> str:
    """A PNG as a data URI: as it is, or as a JPEG where that is smaller, as it is for photos."""
    from PIL import Image

    compressed = io.BytesIO()
    with Image.open(path) as picture:
        picture.convert("RGB").save(compressed, "JPEG", quality=_QUALITY)
    kind, content = min(("png", path.read_bytes()), ("jpeg", compressed.getvalue()), key=lambda form: len(form[1]))
    return f"data:image/{kind};base64,{base64.b64encode(content).decode('ascii')}"
