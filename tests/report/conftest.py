from collections.abc import Iterator

import pytest
from matplotlib.figure import Figure
from matplotlib.text import Text

from tests.made_terrain import cube, sand, sun_lamps, world  # noqa: F401  fixtures

FULL_WIDTH = 1200  # px; narrower figures, drawn for speed, have no room for the text


def cut_words(figure: Figure) -> list[str]:
    """Return the titles, labels and notes that extend beyond the figure."""
    width, height = figure.canvas.get_width_height()
    boxes = {text.get_text(): text.get_window_extent() for text in _words(figure) if text.get_text().strip()}
    return [
        words for words, box in boxes.items() if min(box.x0, box.y0) < -1 or box.x1 > width + 1 or box.y1 > height + 1
    ]


def _words(figure: Figure) -> Iterator[Text]:
    yield from figure.texts
    for legend in (*figure.legends, *filter(None, (axes.get_legend() for axes in figure.axes))):
        yield from legend.get_texts()
    for axes in figure.axes:
        yield axes._left_title
        yield from axes.texts
        if axes.axison:
            yield from (axes.xaxis.label, axes.yaxis.label)


@pytest.fixture(autouse=True)
def _words_are_whole(monkeypatch) -> Iterator[None]:
    savefig, cut = Figure.savefig, []

    def save_and_check(figure, *arguments, **options):
        savefig(figure, *arguments, **options)
        if figure.canvas.get_width_height()[0] >= FULL_WIDTH:
            cut.extend(cut_words(figure))

    monkeypatch.setattr(Figure, "savefig", save_and_check)
    yield
    assert cut == []
