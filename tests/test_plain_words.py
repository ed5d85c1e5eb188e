"""The prose of code and manual stays close to the English of other projects of the field."""

import ast
import random
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
    found = excesses(total)
    index, share = sum(found.values()), listed_share(total)
    if index > MAX_INDEX or share > MAX_SHARE:
        worst = sorted(found.items(), key=lambda item: -item[1])[:10]
        report = f"index {index:.0f}, {share:.1%} listed, highest excesses {worst}"
        pytest.fail(f"{report}; random docstrings:\n{random_docstrings()}")


@pytest.mark.parametrize("page", PAGES, ids=[str(path.relative_to(ROOT)) for path in PAGES])
def test_a_page_of_the_manual_is_plain(page):
    counts = word_counts(prose(page))
    if counts.total() >= MIN_PAGE_WORDS:
        assert listed_share(counts) <= MAX_PAGE_SHARE, {word: counts[word] for word in RATES if counts[word]}


def random_docstrings(per_package: int = 3) -> str:
    """Random docstrings of each package: a low index alone does not show that a sentence can be read."""
    lines = []
    for package in sorted({path.parent for path in FILES if path.suffix == ".py" and "polarsim" in path.parts}):
        docstrings = [
            (path.name, docstring)
            for path in sorted(package.glob("*.py"))
            for node in ast.walk(ast.parse(path.read_text(encoding="utf-8")))
            if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef) and (docstring := ast.get_docstring(node))
        ]
        lines += [
            f"{package.name}/{name}: {text}"
            for name, text in random.sample(docstrings, min(per_package, len(docstrings)))
        ]
    return "\n".join(lines)
