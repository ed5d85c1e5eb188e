"""Headings, paragraphs, tables and figures, numbered in their order, as one HTML page without other files, or Markdown.

A text names a table or figure by its key in double brackets, such as [[ipd]]; the page puts "Table 2" there.
"""

from __future__ import annotations

import base64
import html
import io
import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import jinja2
import pandas as pd

from polarsim.tables.layout import cells, markdown

_QUALITY = 88  # of JPEGs: lines and digits stay sharp
_REFERENCE = re.compile(r"\[\[([\w-]+)\]\]")
_STYLE = """
body { font: 16px/1.55 Georgia, "DejaVu Serif", serif; color: #202124;
  max-width: 62rem; margin: 2rem auto; padding: 0 1rem; }
h1 { font-size: 1.7rem; } h2 { font-size: 1.25rem; margin-top: 2.2rem; }
p.note { color: #5f6368; font-size: .9rem; }
figure { margin: 1.6rem 0; } figcaption { font-size: .9rem; margin: .4rem 0; } img { max-width: 100%; }
div.wide { overflow-x: auto; }
table { border-collapse: collapse; font-size: .85rem; border-top: 2px solid; border-bottom: 2px solid; }
th { border-bottom: 1px solid; } th, td { padding: .2rem .7rem .2rem 0; text-align: left; white-space: nowrap; }
"""
_PAGE = """<!doctype html>
<html lang="en"><head><meta charset="utf-8"><title>{{ title }}</title><style>{{ style | safe }}</style></head><body>
<h1>{{ title }}</h1>
{% for block in blocks %}{% if block.form == "heading" %}<h2>{{ block.text }}</h2>
{% elif block.form == "note" %}<p class="note">{{ block.text | safe }}</p>
{% elif block.form == "paragraph" %}<p>{{ block.text | safe }}</p>
{% elif block.form == "table" %}<figure id="{{ block.key }}">
<figcaption><b>{{ block.name }}.</b> {{ block.text | safe }}</figcaption>
<div class="wide"><table><thead><tr>{% for name in block.columns %}<th>{{ name }}</th>{% endfor %}</tr></thead>
<tbody>{% for row in block.rows %}<tr>{% for cell in row %}<td>{{ cell }}</td>{% endfor %}</tr>
{% endfor %}</tbody></table></div></figure>
{% else %}<figure id="{{ block.key }}"><img alt="{{ block.name }}" src="{{ block.source }}">
<figcaption><b>{{ block.name }}.</b> {{ block.text | safe }}</figcaption></figure>
{% endif %}{% endfor %}</body></html>
"""


@dataclass(frozen=True)
class Heading:
    text: str


@dataclass(frozen=True)
class Paragraph:
    text: str
    note: bool = False  # in small grey letters


@dataclass(frozen=True)
class Table:
    key: str
    caption: str
    table: pd.DataFrame


@dataclass(frozen=True)
class Figure:
    key: str
    caption: str
    path: Path


Block = Heading | Paragraph | Table | Figure


def numbered(blocks: Sequence[Block]) -> dict[str, str]:
    """Table 1, Figure 1 and so on of every key; tables and figures are counted apart."""
    names: dict[str, str] = {}
    for kind, word in ((Table, "Table"), (Figure, "Figure")):
        keys = [block.key for block in blocks if isinstance(block, kind)]
        names |= {key: f"{word} {number}" for number, key in enumerate(keys, 1)}
    return names


def as_html(title: str, blocks: Sequence[Block]) -> str:
    """One page that stands alone: style and pictures are inside."""
    names = numbered(blocks)
    environment = jinja2.Environment(autoescape=True, undefined=jinja2.StrictUndefined, keep_trailing_newline=True)
    shown = [_for_html(block, names) for block in blocks]
    return environment.from_string(_PAGE).render(title=title, style=_STYLE, blocks=shown)


def as_markdown(title: str, blocks: Sequence[Block], picture_folder: str) -> str:
    """The same in Markdown; pictures are linked from their folder, seen from the page's place."""
    names = numbered(blocks)
    parts = [f"# {title}"]
    for block in blocks:
        if isinstance(block, Heading):
            parts.append(f"## {block.text}")
        elif isinstance(block, Paragraph):
            parts.append(_plain(_told(block.text, names)))
        elif isinstance(block, Table):
            parts.append(markdown(block.table, f"{names[block.key]}. {_told(block.caption, names)}").rstrip())
        else:
            caption = _plain(_told(block.caption, names))
            picture = f"![{names[block.key]}]({picture_folder}/{block.path.name})"
            parts.append(f"{picture}\n\n**{names[block.key]}.** {caption}")
    return "\n\n".join(parts) + "\n"


def _told(text: str, names: dict[str, str]) -> str:
    """The text with the names of what it points to.

    A key that no table or figure has is a bug of ours (KeyError).
    """
    return _REFERENCE.sub(lambda found: names[found[1]], text)


def _plain(text: str) -> str:
    """Text in which Markdown sees no emphasis."""
    return re.sub(r"([*_`<])", r"\\\1", text)


def _linked(text: str, names: dict[str, str]) -> str:
    """As `_told`, as HTML with links."""
    return _REFERENCE.sub(lambda found: f'<a href="#{found[1]}">{names[found[1]]}</a>', html.escape(text, quote=False))


def _for_html(block: Block, names: dict[str, str]) -> dict[str, object]:
    if isinstance(block, Heading):
        return {"form": "heading", "text": block.text}
    if isinstance(block, Paragraph):
        return {"form": "note" if block.note else "paragraph", "text": _linked(block.text, names)}
    shown: dict[str, object] = {"key": block.key, "name": names[block.key], "text": _linked(block.caption, names)}
    if isinstance(block, Table):
        return shown | {
            "form": "table",
            "columns": [str(name) for name in block.table.columns],
            "rows": cells(block.table),
        }
    return shown | {"form": "figure", "source": _embedded(block.path)}


def _embedded(path: Path) -> str:
    """A PNG as a data URI: as it is, or as a JPEG where that is smaller, as it is for photos."""
    from PIL import Image

    compressed = io.BytesIO()
    with Image.open(path) as picture:
        picture.convert("RGB").save(compressed, "JPEG", quality=_QUALITY)
    kind, content = min(("png", path.read_bytes()), ("jpeg", compressed.getvalue()), key=lambda form: len(form[1]))
    return f"data:image/{kind};base64,{base64.b64encode(content).decode('ascii')}"
