"""The prose of code and manual stays close to the English of other projects of the field."""

from collections import Counter
from pathlib import Path

import pytest

from tools.plain_words import RATES, excesses, listed_share, prose, prose_files, word_counts

ROOT = Path(__file__).parent.parent
FILES = prose_files(ROOT)
PAGES = [path for path in FILES if path.suffix == ".md"]
MAX_INDEX = 40
MAX_SHARE = 0.015  # of the words of the whole tree
MAX_PAGE_SHARE = 0.02
MIN_PAGE_WORDS = 100  # in a short text a single word exceeds any share


def test_the_index_of_the_tree_is_low():
    total = sum((word_counts(prose(path)) for path in FILES), Counter())
    worst = sorted(excesses(total).items(), key=lambda item: -item[1])[:10]
    assert sum(excesses(total).values()) <= MAX_INDEX, worst
    assert listed_share(total) <= MAX_SHARE, worst


@pytest.mark.parametrize("page", PAGES, ids=[str(path.relative_to(ROOT)) for path in PAGES])
def test_a_page_of_the_manual_is_plain(page):
    counts = word_counts(prose(page))
    if counts.total() >= MIN_PAGE_WORDS:
        assert listed_share(counts) <= MAX_PAGE_SHARE, {word: counts[word] for word in RATES if counts[word]}
