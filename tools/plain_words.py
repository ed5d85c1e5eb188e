"""Measure how far the prose of a repository is from the English of established projects of its field.

Prose is the text of Markdown pages without code blocks, inline code and links, and in Python files docstrings, comments
and the texts of `help=`, `description=` and raised errors. `plain_words.json` gives, for words that made the text of
this project hard to read, the rate per 10,000 words in the documentation and docstrings of COLMAP, nerfstudio, trimesh,
eradiate and PyPSA-Eur. The excess of a word is its rate here minus three times the rate there, and the index of a
repository is the sum of the positive excesses. Those projects have an index of 0 to 22. On their pages 0.3 to 0.8 % of
the words are listed (medians; 90th percentiles 0.9 to 1.4 %).

The words are symptoms: rewrite the sentence instead of exchanging the word.
"""

from __future__ import annotations

import argparse
import ast
import json
import os
import re
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

RATES: dict[str, float] = json.loads(Path(__file__).with_name("plain_words.json").read_text(encoding="utf-8"))
MIN_RATE = 0.1  # per 10,000 words: a word that the other projects never use may still occur here
TOLERANCE = 3  # multiple of the other projects' rate that has no excess

OUTPUTS = {"results", "data", "build"}  # folders of a checkout without prose

_WORD = re.compile(r"[a-z]+(?:'[a-z]+)?")
_SKIPPED = re.compile(r"(^|/)(vendor|CHANGELOG|LICENSE)")


def prose(path: Path) -> str:
    """Return the prose of a Markdown or Python file."""
    text = path.read_text(encoding="utf-8")
    if path.suffix == ".py":
        return "\n".join(_python_prose(text))
    text = re.sub(r"```.*?```", "", text, flags=re.DOTALL)
    return re.sub(r"https?://\S+", "", re.sub(r"`[^`]*`", "", text))


def _python_prose(source: str) -> Iterator[str]:
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef):
            yield ast.get_docstring(node) or ""
        if isinstance(node, ast.Call):
            yield from (_strings(keyword.value) for keyword in node.keywords if keyword.arg in ("help", "description"))
        if isinstance(node, ast.Raise) and isinstance(node.exc, ast.Call):
            yield from map(_strings, node.exc.args)
    yield "\n".join(re.findall(r"#\s+(.*)", source))


def _strings(node: ast.AST) -> str:
    constants = (inner.value for inner in ast.walk(node) if isinstance(inner, ast.Constant))
    return " ".join(value for value in constants if isinstance(value, str))


def word_counts(text: str) -> Counter[str]:
    """Count the words of a text, in lower case."""
    return Counter(_WORD.findall(text.lower()))


def listed_share(counts: Counter[str]) -> float:
    """Return the share of listed words, 0 to 1."""
    return sum(counts[word] for word in RATES) / max(1, counts.total())


def excesses(counts: Counter[str]) -> dict[str, float]:
    """Return the positive excess of each listed word, per 10,000 words; their sum is the index."""
    total = max(1, counts.total())
    excess = {word: 1e4 * counts[word] / total - TOLERANCE * max(rate, MIN_RATE) for word, rate in RATES.items()}
    return {word: value for word, value in excess.items() if value > 0}


def prose_files(root: Path) -> list[Path]:
    """List the Markdown and Python files of a checkout, without changelog, licence, outputs and hidden folders."""
    kept = []
    for place, folders, names in os.walk(root):
        excluded = OUTPUTS if Path(place) == root else set()
        folders[:] = [name for name in folders if not name.startswith(".") and name not in excluded]
        kept += [Path(place, name) for name in names if name.endswith((".md", ".py")) and not name.startswith(".")]
    return sorted(path for path in kept if not _SKIPPED.search(path.relative_to(root).as_posix()))


def main() -> None:
    """Print the excess of each word, the files with most listed words, the share and the index."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("root", nargs="?", type=Path, default=Path())
    parser.add_argument("--files", type=int, default=25, help="number of files to list, highest count first")
    parser.add_argument("--word", help="list the lines that contain this word instead")
    arguments = parser.parse_args()
    texts = {path.relative_to(arguments.root): prose(path) for path in prose_files(arguments.root)}
    if arguments.word:
        for path, text in texts.items():
            for line in text.splitlines():
                if re.search(rf"\b{arguments.word}\b", line, flags=re.IGNORECASE):
                    print(f"{path}: {line.strip()[:150]}")
        return
    by_file = {path: word_counts(text) for path, text in texts.items()}
    total = sum(by_file.values(), Counter())
    for word, excess in sorted(excesses(total).items(), key=lambda item: -item[1]):
        print(f"{word:10s} {total[word]:6d}  excess {excess:6.2f} per 10,000 words")
    listed = {path: sum(counts[word] for word in RATES) for path, counts in by_file.items()}
    for path in sorted(listed, key=listed.__getitem__, reverse=True)[: arguments.files]:
        print(f"{listed[path]:6d} of {by_file[path].total():6d} words, {listed_share(by_file[path]):6.1%}  {path}")
    print(f"{total.total()} words, {listed_share(total):.1%} listed; index {sum(excesses(total).values()):.0f}")


if __name__ == "__main__":
    main()
