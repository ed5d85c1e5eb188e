"""Create the image of the README from a finished run: `make picture` after `make demo`.

    python docs/readme_picture.py results/demo/figures/strip docs/comparison.jpg

Four panels, two by two: photo, twin, difference and propagated labels.
"""

from __future__ import annotations

import sys
from pathlib import Path

from PIL import Image, ImageDraw

from polarsim.annotate.overlay import font
from polarsim.formats.files import read_json
from polarsim.run_files.pictures import STRIP_TEXT

PANELS = ("photo", "twin", "difference", "labels")
WIDTH, GAP, TITLE = 600, 8, 24  # width of a panel, gap between panels, height of a title, px


def write_picture(strip: Path, out: Path) -> None:
    """Write all available panels of a strip as an image."""
    content = read_json(strip / STRIP_TEXT)
    captions = {name: caption.partition(";")[0] for name, caption in content["panels"]}
    names = [name for name in PANELS if name in captions]
    panels = [Image.open(strip / f"{name}.png").convert("RGB") for name in names]
    height = round(WIDTH * panels[0].height / panels[0].width)
    rows = -(-len(panels) // 2)
    page = Image.new("RGB", (2 * WIDTH + GAP, rows * (height + TITLE)), "white")
    pen = ImageDraw.Draw(page)
    for number, (name, panel) in enumerate(zip(names, panels, strict=True)):
        x, y = number % 2 * (WIDTH + GAP), number // 2 * (height + TITLE)
        title = f"{captions[name]} {content['key']}" if name == "photo" else captions[name]
        pen.text((x, y + 4), title, fill="black", font=font(15))
        page.paste(panel.resize((WIDTH, height), Image.Resampling.LANCZOS), (x, y + TITLE))
    page.save(out, quality=82, optimize=True)


if __name__ == "__main__":
    write_picture(Path(sys.argv[1]), Path(sys.argv[2]))
