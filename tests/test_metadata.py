"""Metadata of the software agree in pyproject.toml, CITATION.cff, .zenodo.json and the paper."""

import json
import re
import tomllib
from pathlib import Path

import pytest
import yaml

import polarsim

CHECKOUT = Path(__file__).parent.parent
PROJECT = tomllib.loads((CHECKOUT / "pyproject.toml").read_text())["project"]
CITATION = yaml.safe_load((CHECKOUT / "CITATION.cff").read_text())
ZENODO = json.loads((CHECKOUT / ".zenodo.json").read_text())
PAPER = (CHECKOUT / "docs/paper/paper.md").read_text()
HEADER = yaml.safe_load(PAPER.split("---")[1])


@pytest.mark.parametrize("cited", [CITATION, CITATION["preferred-citation"]], ids=["software", "preferred citation"])
def test_title_version_licence_and_authors_agree(cited):
    assert cited["title"] == ZENODO["title"] == HEADER["title"]
    assert cited["title"].startswith(f"{PROJECT['name']}: ")
    assert cited["version"] == ZENODO["version"] == PROJECT["version"] == polarsim.__version__
    assert cited["license"] == ZENODO["license"] == PROJECT["license"]
    authors = [author["name"] for author in PROJECT["authors"]]
    for others in (cited["authors"], ZENODO["creators"], HEADER["authors"]):
        assert [author["name"] for author in others] == authors


def test_the_version_is_the_newest_of_the_changelog():
    newest = re.search(r"^## (\S+)", (CHECKOUT / "CHANGELOG.md").read_text(), re.MULTILINE)
    assert newest is not None
    assert newest[1] == polarsim.__version__


def test_zenodo_repeats_description_keywords_and_cited_papers_of_the_project():
    assert ZENODO["description"].startswith(f"{PROJECT['description']}.")
    assert set(PROJECT["keywords"]) <= set(ZENODO["keywords"])
    identifiers = {entry["identifier"].removeprefix("arXiv:") for entry in ZENODO["related_identifiers"]}
    notes = {word for entry in CITATION["references"] for word in re.findall(r"arXiv (\S+)", str(entry))}
    assert identifiers == {number.strip("'},") for number in notes}
    assert identifiers == {url.rpartition("/")[2] for url in PROJECT["urls"].values()}


def test_the_paper_cites_exactly_the_works_of_its_bibliography():
    entries = re.findall(r"^@\w+\{(\w+),", (CHECKOUT / "docs/paper/paper.bib").read_text(), re.MULTILINE)
    assert len(entries) == len(set(entries))
    assert set(re.findall(r"@(\w+)\]", PAPER)) == set(entries)


def test_numbers_of_the_paper_are_those_of_the_manual():
    measured = " ".join((CHECKOUT / name).read_text() for name in ("docs/results.md", "docs/explanation/real-gap.md"))
    numbers = re.findall(r"\b\d+\.\d+(?= %| dB| times|[,; .\]]| \[|$)", PAPER.split("# State of the field")[1])
    assert len(numbers) > 20
    assert [number for number in numbers if not re.search(rf"(?<![\d.]){number}(?!\d)", measured)] == []
